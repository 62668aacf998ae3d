#pragma once

#include "support/process.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace subworld::test {

using Json = nlohmann::json;

inline std::string program(const std::string& name) { return std::string(PROGRAMS_FOLDER) + "/" + name; }
inline std::string scene(const std::string& name) { return std::string(SCENES_FOLDER) + "/" + name + ".yaml"; }

struct Ended {
  int code = -1;
  std::string out;
  std::string err;
};

/// The real programs; each test has its own domain and folder. No process or file may remain after a test. One that
/// fails prints the output of its runs, and leaves its folder.
class ProcessTest : public ::testing::Test {
 protected:
  void TearDown() override {
    if (HasFailure()) explain();
    const auto left = running(folder_.path());
    EXPECT_TRUE(left.empty()) << left.size() << " programs still run, the first is " << left.front().words.front();
    for (const Running& one : left) kill(one.pid, SIGKILL);
    for (const std::string& name : shared_memory_files()) {
      EXPECT_TRUE(shared_memory_before_.contains(name)) << "not removed from /dev/shm: " << name;
    }
  }

  /// `subworld run`; its results are in `out()`.
  [[nodiscard]] Words run_words(const std::string& scene_file, const Words& flags) const {
    Words words{program("subworld"), "run", scene_file, "--out", out()};
    if (std::find(flags.begin(), flags.end(), "--domain") == flags.end())
      words.insert(words.end(), {"--domain", domain_.text()});
    words.insert(words.end(), flags.begin(), flags.end());
    return words;
  }
  Ended finish(const Words& words, const Environment& environment = {}) const {
    Process process(words, folder_.path(), environment);
    const auto code = process.wait();
    EXPECT_TRUE(code) << "still runs: " << words.front();
    runs_.push_back({words, {code.value_or(-1), process.out(), process.err()}});
    return runs_.back().second;
  }
  Ended run(const std::string& scene_file, const Words& flags, const Environment& environment = {}) const {
    return finish(run_words(scene_file, flags), environment);
  }

  /// A copy of a scene with one passage replaced.
  [[nodiscard]] std::string edited(const std::string& name, const std::string& passage, const std::string& by) const {
    std::string text = read_text(scene(name));
    const std::size_t at = text.find(passage);
    EXPECT_NE(at, std::string::npos) << passage;
    return folder_.write(name + ".yaml", text.replace(at, passage.size(), by));
  }
  /// With the haptic preset `quality`, a step of its sub-world takes longer than its period on ordinary machines.
  [[nodiscard]] std::string overloaded_heap() const {
    return edited("heap", "box_half_m: 0.2", "selection: box\n    box_half_m: 0.4");
  }
  /// A lever on a hinge, and a cube that is fixed to a block until the lever lifts it off, at t = 1.07 s.
  [[nodiscard]] std::string glued_lever() const {
    return edited("lever",
                  "joints:", "joints:\n  - {name: glue, type: fixed, bodies: [cube, block], break_force_n: 20}");
  }

  [[nodiscard]] std::string out() const { return folder_.path() + "/out"; }
  [[nodiscard]] Json summary() const { return Json::parse(read_text(out() + "/summary.json"), nullptr, false); }

  const TemporaryFolder folder_;
  const TestDomain domain_;

 private:
  /// Prints what the runs of this test have said, and the logs and the verdict of the last one.
  void explain() const {
    for (const auto& [words, ended] : runs_) {
      std::cout << "----";
      for (const std::string& word : words) std::cout << ' ' << word;
      std::cout << "\nexit code " << ended.code << "\n" << ended.out << ended.err;
    }
    std::error_code ignored;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.path(), ignored)) {
      const std::string name = entry.path().filename();
      if (name != "stdout.txt" && name != "stderr.txt" && name != "summary.json" && entry.path().extension() != ".log")
        continue;
      if (name == "summary.json") {
        const Json json = Json::parse(read_text(entry.path()), nullptr, false);
        std::cout << "---- " << entry.path().string() << "\n"
                  << (json.is_object() ? json.value("verdict", "") : "") << "\n";
        continue;
      }
      const std::string text = read_text(entry.path());
      const bool printed = !runs_.empty() && (text == runs_.back().second.out || text == runs_.back().second.err);
      if (!text.empty() && !printed) std::cout << "---- " << entry.path().string() << "\n" << text;
    }
    folder_.keep();
    std::cout << "---- all of it is in " << folder_.path() << std::endl;
  }

  mutable std::vector<std::pair<Words, Ended>> runs_;
  std::set<std::string> shared_memory_before_ = shared_memory_files();
};

/// A history: names of the columns, and rows of numbers.
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> rows;

  [[nodiscard]] std::size_t column(const std::string& name) const {
    const auto found = std::find(columns.begin(), columns.end(), name);
    EXPECT_NE(found, columns.end()) << "no column " << name;
    return static_cast<std::size_t>(found - columns.begin());
  }
};

/// Without a last row that is not whole: its program is writing it, or was killed.
inline Table read_table(const std::string& file) {
  Table table;
  std::ifstream stream(file);
  std::string line, cell;
  if (std::getline(stream, line)) {
    std::istringstream cells(line);
    while (std::getline(cells, cell, ',')) table.columns.push_back(cell);
  }
  while (std::getline(stream, line) && !stream.eof()) {
    std::istringstream cells(line);
    auto& row = table.rows.emplace_back();
    while (std::getline(cells, cell, ',')) row.push_back(std::strtod(cell.c_str(), nullptr));
    EXPECT_EQ(row.size(), table.columns.size()) << file << ": " << line;
  }
  return table;
}

}  // namespace subworld::test
