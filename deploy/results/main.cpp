#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "report/page.hpp"
#include "results/run_report.hpp"
#include "tools.hpp"

#include <fmt/core.h>

#include <string>
#include <vector>

namespace {

using namespace subworld;

void add_options(CommandLine& line, ReportRequest& request) {
  line.add("results", &request.what, "folder of a run, a session or a lab, or a summary.json or table in one")
      .required();
  line.add("--out", &request.out, "the page, an HTML file").otherwise("report.html in that folder");
  line.footer(
      "Examples:\n"
      "  subworld report out/row\n"
      "  subworld report out/row/summary.json --out row.html\n"
      "The page needs no other file and no network.");
}

/// A lab writes the page of its folder itself.
int main_of(int argc, char** argv) {
  CommandLine line("subworld report", about_tool("report"));
  ReportRequest request;
  add_options(line, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  const ReportPlace place = place_of(request);
  if (place.lab.empty()) {
    write_report(place);
    return static_cast<int>(ExitCode::done);
  }
  if (!is_lab(place.lab))
    throw Error(ExitCode::failed, fmt::format("{}: no lab is called \"{}\"", place.folder, place.lab));
  std::vector<std::string> words{"lab_" + place.lab, kWriteReport, place.folder, place.page};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  become(words.front(), arguments.data());
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld report",
                            subworld::guarded("subworld report", [&] { return main_of(argc, argv); }));
}
