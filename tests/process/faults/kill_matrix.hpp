#pragma once

#include "process/process_test.hpp"

#include <map>
#include <optional>
#include <ostream>
#include <regex>
#include <thread>

namespace subworld::test {

/// A program of a run of `subworld run --gui` gets a signal. The page of the launcher has the exit code and the verdict
/// of each such case in a table, which these tests read.
struct KillCell {
  std::string program;  ///< "subworld": the launcher
  std::string signal;
  std::string column;  ///< of the table
};
inline void PrintTo(const KillCell& one, std::ostream* out) {
  *out << one.program << ", " << one.signal << ", " << one.column;
}

inline constexpr const char* kLockstepColumn = "lock-step";
inline constexpr const char* kRealTimeColumn = "real time";
inline constexpr const char* kRestartColumn = "real time, `--restart on-failure`";

inline std::vector<KillCell> kill_cells() {
  std::vector<KillCell> all;
  for (const char* column : {kLockstepColumn, kRealTimeColumn, kRestartColumn}) {
    for (const char* program : {"world_sim", "haptic_sim", "device_sim", "gui_headless", "subworld"}) {
      for (const char* signal : {"SIGKILL", "SIGSTOP", "SIGTERM", "SIGINT", "SIGHUP"})
        all.push_back({program, signal, column});
    }
  }
  return all;
}

/// Of each program each signal once, in alternating columns.
inline std::vector<KillCell> some_cells() {
  std::vector<KillCell> some;
  const std::vector<KillCell> all = kill_cells();
  const std::size_t rows = all.size() / 3;
  for (std::size_t row = 0; row < rows; ++row) {
    if (all[row].signal != "SIGHUP") some.push_back(all[row + rows * ((row + row / 5) % 3)]);
  }
  return some;
}

inline std::string name_of_cell(const ::testing::TestParamInfo<KillCell>& one) {
  const std::string& column = one.param.column;
  return one.param.program + "_" + one.param.signal +
         (column == kLockstepColumn   ? "_lockstep"
          : column == kRealTimeColumn ? "_realtime"
                                      : "_restart");
}

/// The table of the page: what follows a signal to a program, by program, signal and column.
class KillTable {
 public:
  struct Expected {
    int code = -1;
    std::string verdict;  ///< `...` stands for any text
  };

  KillTable() {
    std::istringstream page(read_text(std::string(SOURCE_FOLDER) + "/deploy/README.md"));
    std::string line;
    std::vector<std::string> columns;
    while (std::getline(page, line)) {
      const std::vector<std::string> cells = cells_of(line);
      if (columns.empty() && (cells.size() < 2 || cells[0] != "program" || cells[1] != "signal")) continue;
      if (cells.empty()) break;
      if (columns.empty()) {
        columns = cells;
      } else if (!cells[0].starts_with("---")) {
        add_row(columns, cells);
      }
    }
  }
  [[nodiscard]] std::optional<Expected> at(const KillCell& cell) const {
    const auto found = expected_.find({cell.program, cell.signal, cell.column});
    return found == expected_.end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] std::size_t size() const { return expected_.size(); }

 private:
  static std::vector<std::string> cells_of(const std::string& line) {
    std::vector<std::string> cells;
    if (!line.starts_with("| ") && !line.starts_with("|-")) return cells;
    std::istringstream stream(line.substr(1));
    for (std::string cell; std::getline(stream, cell, '|');) {
      const std::size_t begin = cell.find_first_not_of(' ');
      cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, cell.find_last_not_of(' ') - begin + 1));
    }
    return cells;
  }
  static std::vector<std::string> words_of(const std::string& cell) {
    std::vector<std::string> words;
    const std::regex word("[A-Za-z_]+");
    for (std::sregex_iterator at(cell.begin(), cell.end(), word), end; at != end; ++at) words.push_back(at->str());
    return words;
  }
  /// A row may stand for several programs and several signals.
  void add_row(const std::vector<std::string>& columns, const std::vector<std::string>& cells) {
    ASSERT_EQ(cells.size(), columns.size()) << cells[0];
    const std::regex form("(\\d+), `([^`]*)`");
    for (std::size_t i = 2; i < cells.size(); ++i) {
      std::smatch parts;
      ASSERT_TRUE(std::regex_match(cells[i], parts, form)) << cells[i];
      for (const std::string& program : words_of(cells[0])) {
        for (const std::string& signal : words_of(cells[1])) {
          const std::string label = program == "haptic_sim" || program == "device_sim" ? program + "_0" : program;
          std::string verdict = std::regex_replace(parts[2].str(), std::regex("PROGRAM"), label);
          verdict = std::regex_replace(verdict, std::regex("SIGNAL"), signal);
          const bool is_new =
              expected_.emplace(std::tuple(program, signal, columns[i]), Expected{std::stoi(parts[1]), verdict}).second;
          EXPECT_TRUE(is_new) << program << ", " << signal << " stands in two rows";
        }
      }
    }
  }

  std::map<std::tuple<std::string, std::string, std::string>, Expected> expected_;
};

class KillMatrix : public ProcessTest, public ::testing::WithParamInterface<KillCell> {
 protected:
  /// A run in the middle of its loops.
  void start() {
    const KillCell& cell = GetParam();
    const bool realtime = cell.column != kLockstepColumn;
    duration_s_ = !goes_on() ? 1000.0 : realtime ? 4.0 : 20.0;
    Words flags{"--mode",     realtime ? "realtime" : "lockstep", "--dds", "mixed",
                "--duration", std::to_string(duration_s_)};
    if (cell.program == "gui_headless") flags.emplace_back("--gui");
    if (cell.column == kRestartColumn) flags.insert(flags.end(), {"--restart", "on-failure"});
    process_.emplace(run_words(scene("press"), flags), folder_.path());
    // Each program writes its history ten times a second.
    ASSERT_TRUE(eventually([&] {
      return read_text(out() + "/haptic_0.csv").size() > 10000 && read_text(out() + "/device_0.csv").size() > 1000 &&
             read_text(out() + "/world.csv").size() > 1000;
    })) << process_->err();
  }
  /// The run lasts to its end.
  [[nodiscard]] bool goes_on() const { return expected_.code == 0 && !expected_.verdict.starts_with("stopped"); }

  void send() {
    const KillCell& cell = GetParam();
    const std::map<std::string, int> numbers{
        {"SIGKILL", SIGKILL}, {"SIGSTOP", SIGSTOP}, {"SIGTERM", SIGTERM}, {"SIGINT", SIGINT}, {"SIGHUP", SIGHUP}};
    const int number = numbers.at(cell.signal);
    if (cell.program != "subworld") {
      int found = 0;
      for (const Running& one : running(out())) {
        if (!one.words.front().ends_with("/" + cell.program)) continue;
        kill(one.pid, number);
        ++found;
      }
      ASSERT_EQ(found, 1);
      return;
    }
    process_->signal(number);
    if (number != SIGSTOP) return;
    const auto programs = [&] {
      const std::vector<Running> all = running(out());
      return std::ranges::count_if(all, [](const Running& one) { return one.words.front().ends_with("_sim"); });
    };
    ASSERT_TRUE(eventually([&] { return programs() == 0; })) << "the programs need the launcher";
    process_->signal(SIGCONT);
  }

  /// Whether the text has the pieces of the pattern in their order. On a busy machine a run in real time may miss gates
  /// of timing, which is another verdict with the same exit code.
  [[nodiscard]] static bool matches(std::string text, const std::string& pattern, bool realtime) {
    if (realtime && pattern.starts_with("ok") && text.starts_with("quality gate missed"))
      text.replace(0, text.find(';'), "ok");
    std::size_t at = 0;
    for (std::size_t from = 0; from <= pattern.size();) {
      const std::size_t to = std::min(pattern.find("...", from), pattern.size());
      const std::size_t found = text.find(pattern.substr(from, to - from), at);
      if (found == std::string::npos || (from == 0 && found != 0)) return false;
      at = found + to - from;
      from = to + 3;
    }
    return true;
  }

  [[nodiscard]] std::string printed_verdict() const {
    std::smatch found;
    const std::string text = process_->out();
    return std::regex_search(text, found, std::regex("\nverdict: ([^\n]*)")) ? found[1].str() : "";
  }

  KillTable::Expected expected_;
  double duration_s_ = 0.0;
  std::optional<Process> process_;
};

TEST_P(KillMatrix, EndsAsThePageSays) {
  const KillCell& cell = GetParam();
  const std::optional<KillTable::Expected> expected = KillTable().at(cell);
  ASSERT_TRUE(expected) << "deploy/README.md has no such row";
  expected_ = *expected;
  start();
  if (!HasFatalFailure()) send();
  if (HasFatalFailure()) return;
  const auto code = process_->wait();
  ASSERT_TRUE(eventually([&] { return running(out()).empty(); }));
  const std::string verdict = printed_verdict();
  EXPECT_TRUE(code == expected_.code && matches(verdict, expected_.verdict, cell.column != kLockstepColumn))
      << "deploy/README.md has " << expected_.code << ", `" << expected_.verdict << "`; the run ended with\n"
      << code.value_or(-1) << ", `" << verdict << "`\n"
      << process_->err();
  // The summary has what was measured, of the killed program what its history holds.
  const Json json = summary();
  ASSERT_TRUE(json.is_object());
  EXPECT_TRUE(verdict.starts_with(json["verdict"].get<std::string>())) << json["verdict"];
  for (const auto& entry : std::filesystem::directory_iterator(out()))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
  const bool lost = code != 0 && (cell.signal == "SIGKILL" || cell.signal == "SIGSTOP");
  const std::map<std::string, Json> parts{
      {"world_sim", json["world"]}, {"haptic_sim", json["haptic"][0]}, {"device_sim", json["device"][0]}};
  for (const auto& [name, part] : parts) {
    EXPECT_GT(part[name == "world_sim" ? "cycles" : "steps"].get<double>(), 0.0) << name;
    EXPECT_EQ(part.contains("partial"), lost && name == cell.program) << name;
    EXPECT_NE(part.contains("ending"), lost && name == cell.program) << name;
  }
  EXPECT_GT(json["simulated_s"].get<double>(), 0.0);
  if (goes_on()) {
    EXPECT_NEAR(json["simulated_s"].get<double>(), duration_s_, 0.01);
    EXPECT_FALSE(json.contains("partial"));
  }
}

}  // namespace subworld::test
