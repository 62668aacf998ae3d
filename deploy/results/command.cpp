#include "results/command.hpp"

#include "io/json.hpp"
#include "model/error.hpp"
#include "results/run_report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>

namespace subworld {

namespace fs = std::filesystem;

namespace {

/// What the programs of a run write before it has a summary.
constexpr std::array kPartsOfARun{"world.json", "world.csv", "haptic_0.json", "haptic_0.csv", "device_0.csv", "hosts"};

/// The folder of the results that a path names.
fs::path folder_of(const std::string& what) {
  std::error_code ignored;
  if (fs::is_directory(what, ignored)) return what;
  if (!fs::exists(what, ignored)) {
    throw Error(ExitCode::usage, fmt::format("{}: no such folder or file; name the folder that a run, a session or a "
                                             "lab wrote its results to",
                                             what));
  }
  const fs::path folder = fs::path(what).parent_path();
  return folder.empty() ? "." : folder;
}

}  // namespace

void add_report_options(CommandLine& line, ReportRequest& request) {
  line.add("results", &request.what, "folder of a run, a session or a lab, or a summary.json or table in one")
      .required();
  line.add("--out", &request.out, "the page, an HTML file").otherwise("report.html in that folder");
  line.footer(
      "Examples:\n"
      "  subworld report out/row\n"
      "  subworld report out/row/summary.json --out row.html\n"
      "The page needs no other file and no network.");
}

ReportPlace place_of(const ReportRequest& request) {
  const fs::path folder = folder_of(request.what);
  const fs::path summary = folder / "summary.json";
  if (!fs::exists(summary)) {
    const bool ran = std::ranges::any_of(kPartsOfARun, [&](const char* part) { return fs::exists(folder / part); });
    throw Error(ExitCode::usage,
                fmt::format("{}: has no summary.json{}", folder.string(),
                            ran ? "; `subworld collect` makes one of what programs of a run wrote"
                                : ": no run and no lab has ended here; name the folder that its --out named"));
  }
  const Json json = read_json(summary.string());
  if (!json.is_object() || json.empty())
    throw Error(ExitCode::failed, fmt::format("{}: is no summary of a run or a lab", summary.string()));
  ReportPlace place{.folder = folder.string(), .page = request.out, .lab = ""};
  if (place.page.empty()) place.page = (folder / "report.html").string();
  if (fs::is_directory(place.page)) place.page = (fs::path(place.page) / "report.html").string();
  if (json.contains("lab") && json["lab"].is_string()) place.lab = json["lab"];
  if (place.lab.empty() && !json.contains("scene") && !json.contains("verdict"))
    throw Error(ExitCode::failed, fmt::format("{}: is no summary of a run or a lab", summary.string()));
  return place;
}

void write_report(const ReportPlace& place) {
  write_run_report(place.page, read_json(place.folder + "/summary.json"), place.folder);
  fmt::print("report: {}\n", place.page);
}

}  // namespace subworld
