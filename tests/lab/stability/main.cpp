#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/random/report.hpp"
#include "lab/stability/plan.hpp"
#include "lab/stability/report.hpp"
#include "lab/stability/run.hpp"
#include "lab/stability/summary.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

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
void add_random(CommandLine& line, Command& command, int& only) {
  RandomRequest& random = command.random;
  const Option scenes = line.add("--random", &random.scenes,
                                 fmt::format("number of random scenes in each engine and preset, {} where it is left "
                                             "out; of the cases only those that are named",
                                             kRandomScenes))
                            .implies(std::to_string(kRandomScenes))
                            .range(1, 1'000'000)
                            .otherwise("none");
  add_seed(line, random.seed).needs(scenes);
  line.add("--scene-index", &only, "only this random scene, from 0, with its details")
      .range(0, 1'000'000'000)
      .otherwise("all")
      .needs(scenes);
  line.flag("--strict", command.strict, "exit code 4 where a random scene fails").needs(scenes);
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Command& command) {
  StabilityRequest& request = command.request;
  CommandLine line(
      "subworld lab stability",
      "Maps where the engines are numerically stable: each case measures one quantity, or searches a limit "
      "by bisection, and compares it with a formula or a reference. A row gives the margin: error over "
      "tolerance.");
  line.footer(fmt::format(
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
      "the force on each operator. Failures are made small and stored in DIR/failures; DIR/random.csv holds a row for "
      "each.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene, 4 a random "
      "scene failed (--strict).",
      cases_text()));
  line.add("case", &request.names, "names of cases or groups").otherwise("all");
  line.add("--engine", &request.engines, "engines, separated by commas").otherwise("all that are installed");
  line.add("--preset", &request.presets, "presets of the engines").otherwise("all");
  line.add("--dt", &command.steps, "time steps in s, as in 1/60 or 0.01").otherwise("1/1000,1/250,1/60");
  line.flag("--quick", request.quick,
            "a first look: the first value of each case, at 1/1000 and 1/250 s where no other step is given");
  int only = -1;
  add_random(line, command, only);
  add_out(line, "stability", command.out);
  if (const auto code = line.parse(argc, argv)) return code;

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
  const auto again = [](const std::string& folder, const std::string& page) {
    write_stability_report(page, read_rows(folder + "/results.json"), read_json(folder + "/summary.json"));
  };
  if (const auto code = report_again(argc, argv, again)) return *code;
  Command command;
  if (const auto code = parse(argc, argv, command)) return *code;
  const std::vector<StabilityPoint> points = command.cases ? points_of(command.request) : std::vector<StabilityPoint>{};
  open_results("stability", command.out);
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
  const int code = end_lab(
      command.out, rows, summary, [&](const std::string& page) { write_stability_report(page, rows, summary); },
      random ? "random.csv" : "");
  return random && command.strict && !all_held(summary.at("random")) ? static_cast<int>(ExitCode::quality) : code;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab stability", [&] { return run_lab(argc, argv); });
}
