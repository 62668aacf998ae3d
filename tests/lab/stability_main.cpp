#include "io/command_line.hpp"
#include "io/options.hpp"
#include "lab/command_line.hpp"
#include "lab/engine_choice.hpp"
#include "lab/stability_plan.hpp"
#include "lab/stability_report.hpp"
#include "lab/stability_run.hpp"
#include "lab/stability_summary.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

namespace {

using namespace subworld;

struct Command {
  StabilityRequest request;
  std::vector<std::string> steps;  ///< as written
  std::string out;
};

/// Throws `Error` (usage). An exit code where nothing is left to do.
std::optional<int> parse(int argc, char** argv, Command& command) {
  StabilityRequest& request = command.request;
  CLI::App app{
      "Maps where the engines are numerically stable: each case measures one quantity, or searches a limit by "
      "bisection, and holds it against a formula or a reference. A row gives the margin: error over tolerance.",
      "subworld lab stability"};
  app.footer(fmt::format(
      "Cases by group:\n{}\n\n"
      "Examples:\n"
      "  subworld lab stability --quick --out out/quick\n"
      "  subworld lab stability sliding slip_angle --engine bullet --dt 1/1000 --out out/sliding\n"
      "  subworld lab stability hand delay --engine bullet,physx --preset fast\n"
      "  subworld lab stability stack card_house heavy_on_light --preset quality --dt 1/60,1/250,1/1000\n"
      "DIR/report.html shows the map and a section for each case with its formula and source; DIR/results.csv and\n"
      "results.json hold a row for each measurement. A missed tolerance is a result: it does not change the exit "
      "code.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.",
      cases_text()));
  app.add_option("case", request.names, "names of cases or groups (default: all)");
  add_list(app, "--engine", request.engines, "engines, separated by commas (default: all there are)");
  add_list(app, "--preset", request.presets, "presets of the engines (default: all)");
  add_list(app, "--dt", command.steps, "time steps, s, as in 1/60 or 0.01 (default: 1/1000,1/250,1/60)");
  app.add_flag("--quick", request.quick,
               "a first look: the first value of each case, at 1/1000 and 1/250 s where no other step is asked for");
  add_out(app, "stability", command.out);
  if (const auto code = parse_arguments(app, argc, argv)) return code;

  for (const std::string& step : command.steps) request.steps_s.push_back(step_of(step));
  if (request.engines.empty()) request.engines = engine_names();
  request.engines = in_display_order(request.engines);
  if (command.out.empty()) command.out = default_out("stability");
  return std::nullopt;
}

/// Rows come setting by setting; those of a setting are kept when it is done.
Rows measure(const std::vector<StabilityPoint>& points, const std::string& out) {
  Rows rows;
  StabilityProgress progress(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::optional<Json> row = measured_row(points[i]);
    if (!row) break;
    rows.push_back(*row);
    progress.after(*row);
    if (i + 1 == points.size() || points[i + 1].setting != points[i].setting) write_json(out + "/results.json", rows);
  }
  return rows;
}

int run_lab(int argc, char** argv) {
  Command command;
  if (const auto code = parse(argc, argv, command)) return *code;
  const std::vector<StabilityPoint> points = points_of(command.request);
  make_folder(command.out);
  watch_stop_signals();
  fmt::print("subworld lab stability: {} measurements, results in {}\n", points.size(), command.out);
  std::fflush(stdout);

  const Rows rows = measure(points, command.out);
  const Json summary = stability_summary(command.request, rows, points.size());
  for (const Json& line : summary.at("advice")) fmt::print("{}\n", line.get<std::string>());
  return end_lab(command.out, rows, summary,
                 [&](const std::string& page) { write_stability_report(page, rows, summary); });
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab stability", [&] { return run_lab(argc, argv); });
}
