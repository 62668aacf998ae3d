#include "io/command_line.hpp"
#include "io/options.hpp"
#include "lab/command_line.hpp"
#include "lab/engine_choice.hpp"
#include "lab/random_report.hpp"
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

constexpr int kRandomScenes = 100;

struct Command {
  StabilityRequest request;
  RandomRequest random;
  bool cases = true;               ///< run the cases too, and not only random scenes
  bool strict = false;             ///< a failing random scene fails the lab
  std::vector<std::string> steps;  ///< as written
  std::string out;
};

/// Options of the random scenes. `only`: index of a single scene, or negative for all.
void add_random(CLI::App& app, Command& command, int& only) {
  RandomRequest& random = command.random;
  CLI::Option* scenes =
      app.add_option("--random", random.scenes,
                     fmt::format("run so many random scenes in each engine and preset (default: {}), and of the cases "
                                 "only those that are named",
                                 kRandomScenes))
          ->expected(0, 1)
          ->default_str(std::to_string(kRandomScenes))
          ->check(CLI::Range(1, 1'000'000));
  add_seed(app, random.seed)->needs(scenes);
  app.add_option("--scene-index", only, "of the random scenes only this one, from 0, with its details")
      ->needs(scenes)
      ->check(CLI::Range(0, 1'000'000'000));
  app.add_flag("--strict", command.strict, "exit with 4 where a random scene fails")->needs(scenes);
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
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
      "  subworld lab stability operator delay --engine bullet,physx --preset fast\n"
      "  subworld lab stability stack card_house heavy_on_light --preset quality --dt 1/60,1/250,1/1000\n"
      "  subworld lab stability --random 300 --seed 7 --engine bullet --preset fast --strict --out out/random\n"
      "DIR/report.html shows the map and a section for each case with its formula and source; DIR/results.csv and\n"
      "results.json hold a row for each measurement. A missed tolerance is a result: it does not change the exit "
      "code.\n"
      "--random runs random scenes instead: twice each, judged by crashes, states that are not finite, hash, energy "
      "and\n"
      "the force on each hand. What fails is made small and kept in DIR/failures; DIR/random.csv holds a row for "
      "each.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene, 4 a random "
      "scene failed (--strict).",
      cases_text()));
  app.add_option("case", request.names, "names of cases or groups (default: all)");
  add_list(app, "--engine", request.engines, "engines, separated by commas (default: all there are)");
  add_list(app, "--preset", request.presets, "presets of the engines (default: all)");
  add_list(app, "--dt", command.steps, "time steps, s, as in 1/60 or 0.01 (default: 1/1000,1/250,1/60)");
  app.add_flag("--quick", request.quick,
               "a first look: the first value of each case, at 1/1000 and 1/250 s where no other step is asked for");
  int only = -1;
  add_random(app, command, only);
  add_out(app, "stability", command.out);
  if (const auto code = parse_arguments(app, argc, argv)) return code;

  for (const std::string& step : command.steps) request.steps_s.push_back(step_of(step));
  if (request.engines.empty()) request.engines = engine_names();
  request.engines = in_display_order(request.engines);
  if (command.out.empty()) command.out = default_out("stability");
  if (only >= 0) command.random.only = only;
  command.random.out = command.out;
  const bool random = command.random.scenes > 0;
  if (random) command.random.settings = random_settings(request.engines, request.presets);
  command.cases = !random || !request.names.empty();
  return std::nullopt;
}

/// Measures setting by setting, and saves the rows of a setting when it is done.
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
  const std::vector<StabilityPoint> points = command.cases ? points_of(command.request) : std::vector<StabilityPoint>{};
  make_folder(command.out);
  watch_stop_signals();
  fmt::print("subworld lab stability: {} measurements{}, results in {}\n", points.size(),
             command.random.scenes > 0 ? " and random scenes" : "", command.out);
  std::fflush(stdout);

  const Rows rows = measure(points, command.out);
  const bool random = command.random.scenes > 0;
  const Rows scenes = random && stop_signal() == 0 ? random_rows(command.random) : Rows{};
  Json summary = stability_summary(command.request, rows, points.size());
  for (const Json& line : summary.at("advice")) fmt::print("{}\n", line.get<std::string>());
  if (random) {
    write_json(command.out + "/random.json", scenes);
    write_csv(command.out + "/random.csv", scenes);
    summary["random"] = random_summary(command.random, scenes);
    summary["verdict"] = random_verdict(summary.at("random"), points.empty() ? "" : summary.at("verdict"));
    fmt::print("{}", random_text(summary.at("random")));
  }
  const int code = end_lab(command.out, rows, summary,
                           [&](const std::string& page) { write_stability_report(page, rows, summary); });
  return random && command.strict && !all_held(summary.at("random")) ? static_cast<int>(ExitCode::quality) : code;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab stability", [&] { return run_lab(argc, argv); });
}
