#include "lab/page/command_line.hpp"

#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "io/results/output.hpp"
#include "io/results/replacing.hpp"
#include "model/error.hpp"
#include "model/places.hpp"
#include "report/page.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <cstring>
#include <ctime>
#include <filesystem>
#include <string_view>

namespace subworld {

std::vector<std::string> scene_files(const std::vector<std::string>& names) {
  if (data_folder("scenes").empty()) {
    throw Error(ExitCode::usage,
                "no folder of scenes is above this program (share/subworld/scenes or deploy/scenes); name the scene "
                "files on the command line");
  }
  std::vector<std::string> files;
  for (const std::string& name : names) files.push_back(scene_file(name));
  return files;
}

Option add_seed(CommandLine& line, std::uint64_t& seed, const std::string& what) {
  constexpr double kMost = 9e15;  // that every program that reads a table can hold
  return line.add("--seed", &seed, what).range(0.0, kMost);
}

void add_out(CommandLine& line, const std::string& lab, std::string& out) {
  line.add("--out", &out, "folder for the results").otherwise(fmt::format("out/lab_{}-TIME", lab));
}

Option add_duration(CommandLine& line, std::optional<double>& duration_s) {
  return line.add("--duration", &duration_s, "simulated time").range(0.05, 1e4, "s").otherwise("the scene's");
}

std::string default_out(const std::string& lab) {
  return fmt::format("out/lab_{}-{}", lab, local_time("%Y%m%d-%H%M%S"));
}

void open_results(const std::string& lab, const std::string& out) {
  namespace fs = std::filesystem;
  make_folder(out);
  const fs::path summary = out + "/summary.json";
  // The tables look like those of other programs. They are ours where the summary is.
  const bool ours = fs::exists(summary) && is_result(summary);
  std::vector<fs::path> files{summary, out + "/report.html"};
  for (const char* table : {"results", "bodies", "felt", "random", "users"}) {
    for (const char* kind : {".json", ".csv"}) {
      if (!ours) files.emplace_back(fmt::format("{}/{}{}", out, table, kind));
    }
  }
  check_results(out, files);
  if (!fs::exists(summary)) write_json(summary, {{"lab", lab}, {"verdict", "the lab has not ended"}});
}

Json begin_summary(const std::string& lab, std::size_t points, std::size_t planned) {
  return {{"lab", lab},
          {"date", local_time("%Y-%m-%d %H:%M")},
          {"points", points},
          {"planned", planned},
          {"machine", machine()}};
}

std::string stopped_text(std::size_t points, std::size_t planned) {
  return points < planned ? fmt::format("; stopped after {} of {} points", points, planned) : "";
}

int end_lab(const std::string& out, const Rows& rows, const Json& summary,
            const std::function<void(const std::string&)>& report, const std::string& other_table) {
  if (!rows.empty()) {
    write_json(out + "/results.json", rows);
    write_csv(out + "/results.csv", rows);
  }
  write_json(out + "/summary.json", summary);
  const std::string table = !rows.empty() ? "results.csv" : other_table.empty() ? "summary.json" : other_table;
  fmt::print("{}{}\nresults: {}/{}\n",
             stop_signal() != 0 ? fmt::format("stopped by SIG{}: ", sigabbrev_np(stop_signal())) : "",
             summary.at("verdict").get<std::string>(), out, table);
  const std::string page = out + "/report.html";
  report(page);
  fmt::print("report: {}\n", page);
  return static_cast<int>(ExitCode::done);
}

std::optional<int> report_again(int argc, char** argv,
                                const std::function<void(const std::string& folder, const std::string& page)>& write) {
  constexpr int kWords = 4;
  if (argc != kWords || std::string_view(argv[1]) != kWriteReport) return std::nullopt;
  const std::string folder = argv[2], page = argv[3];
  try {
    write(folder, page);
  } catch (const nlohmann::json::exception& wrong) {
    throw Error(ExitCode::failed,
                fmt::format("{}: its tables are incomplete, or of another version of this lab ({}); measure again",
                            folder, wrong.what()));
  }
  fmt::print("report: {}\n", page);
  return static_cast<int>(ExitCode::done);
}

std::string about_text(double s) {
  return s < 90.0 ? fmt::format("about {:.0f} s", s) : fmt::format("about {:.0f} min", s / 60.0);
}

std::string left_text(double left_s) { return left_s > 0.0 ? fmt::format("  {} left", about_text(left_s)) : ""; }

std::string TimeLeft::text(double done) const {
  const double passed_s = std::chrono::duration<double>(Clock::now() - begin_).count();
  return left_text(passed_s / done * (work_ - done));
}

}  // namespace subworld
