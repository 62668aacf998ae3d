#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "lab/engines/progress.hpp"
#include "lab/engines/report.hpp"
#include "lab/engines/summary.hpp"
#include "lab/engines/sweep.hpp"
#include "lab/page/command_line.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <sstream>

namespace {

using namespace subworld;

constexpr double kQuickDuration_s = 1.0;
constexpr std::size_t kHelpWidth = 112;
const std::vector<std::string> kScenes{"stack", "card_house", "basin"};
const std::vector<std::string> kQuickScenes{"stack", "card_house"};

struct Request {
  EngineSweep sweep;
  std::vector<std::string> steps;  ///< as written
  bool costs = false;              ///< figure 12
  bool states = false;
  std::string out;
};

/// In lines of at most kHelpWidth characters.
std::string folded(const std::string& text) {
  std::istringstream words(text);
  std::string lines;
  std::size_t width = 0;
  for (std::string word; words >> word; width += word.size() + 1) {
    const bool next_line = width + word.size() > kHelpWidth;
    if (next_line) width = 0;
    lines += (lines.empty() ? "" : next_line ? "\n" : " ") + word;
  }
  return lines;
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  EngineSweep& sweep = request.sweep;
  CommandLine line(
      "subworld lab engines",
      "Measures the physics engines alone, without any coupling: the cost of a step, and whether structures "
      "stand. Every combination of the options is run; an option takes a list, separated by commas.");
  line.footer(fmt::format(
      "Without --friction, --restitution and --dt the five combinations of the paper's Table 1 are run (friction 0.5,\n"
      "0.5, 0.5, 1, 0; restitution 0.4, 0, 0.4, 0.4, 0.4; dt 1/60, 1/60, 1/100, 1/60, 1/60), and structures at finer\n"
      "steps too.\n\n{}\n\n"
      "Examples:\n"
      "  subworld lab engines --quick --out out/quick\n"
      "  subworld lab engines stack card_house --out out/structures\n"
      "  subworld lab engines stack --dt 1/60,1/120,1/240,1/1000 --friction 0.5 --restitution 0\n"
      "  subworld lab engines basin --engine {} --preset fast --duration 2 --states\n"
      "  subworld lab engines --figure12 --out out/bodies\n"
      "DIR/report.html shows the results, DIR/results.csv and results.json hold them, DIR/histories the course of "
      "each\n"
      "run, DIR/bodies.csv the step times of figure 12. Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.",
      folded(kHeldInWords), joined(in_display_order(engine_names()), ",")));
  line.add("scene", &sweep.scenes, "scene files, or names of scenes of Subworld").otherwise(joined(kScenes, " "));
  line.add("--engine", &sweep.engines, "engines").otherwise("all that are installed");
  line.add("--preset", &sweep.presets, "presets of the engines")
      .otherwise("all for a structure, the first for a scene that falls");
  line.add("--dt", &request.steps, "time steps in s, as in 1/60 or 0.01").otherwise("Table 1");
  line.add("--friction", &sweep.frictions, "friction coefficients of each pair").range(0.0, 10.0).otherwise("Table 1");
  line.add("--restitution", &sweep.restitutions, "restitution of each pair").range(0.0, 1.0).otherwise("Table 1");
  const Option duration = line.add("--duration", &sweep.duration_s, "simulated time").range(0.01, 1e4, "s");
  line.flag("--figure12", request.costs,
            "step time against the number of bodies; alone: no scenes (a run without scenes and without --quick has it "
            "anyway)");
  line.flag("--states", request.states, "also the states of all bodies over time, in DIR/states");
  line.flag("--quick", sweep.quick,
            fmt::format("a first look: scenes {}, two combinations, {:g} s, where nothing else is given",
                        joined(kQuickScenes, " "), kQuickDuration_s));
  add_out(line, "engines", request.out);
  if (const auto code = line.parse(argc, argv)) return code;

  for (const std::string& step : request.steps) sweep.steps_s.push_back(step_of(step));
  if (sweep.quick && !duration.given()) sweep.duration_s = kQuickDuration_s;
  if (sweep.scenes.empty() && (!request.costs || sweep.quick))
    sweep.scenes = scene_files(sweep.quick ? kQuickScenes : kScenes), request.costs |= !sweep.quick;
  for (std::string& scene : sweep.scenes) scene = scene_file(scene);
  if (sweep.engines.empty()) sweep.engines = engine_names();
  sweep.engines = in_display_order(sweep.engines);
  if (request.out.empty()) request.out = default_out("engines");
  return std::nullopt;
}

EnginePlan plan_of(const Request& request) {
  EnginePlan plan;
  for (const std::string& file : request.sweep.scenes) plan.scenes.push_back(load_lab_scene(file));
  plan.points = points_of(request.sweep, plan.scenes);
  for (const std::string& engine : request.sweep.engines) {
    for (const std::string& preset : presets_of(request.sweep, engine, SceneKind::fall)) {
      if (request.costs) plan.costs.emplace_back(engine, preset);
    }
  }
  return plan;
}

void run_points(const Request& request, const EnginePlan& plan, EngineFindings& found) {
  EngineProgress progress(plan.points);
  for (const EnginePoint& point : plan.points) {
    const std::string states =
        request.states ? fmt::format("{}/states/{}.csv", request.out, point.file_name()) : std::string();
    std::optional<EngineRun> run = run_engine(point, states, [&](double t_s) { progress.during(t_s); });
    if (!run) return;
    write_csv(fmt::format("{}/histories/{}.csv", request.out, point.file_name()), run->history);
    found.rows.push_back(run->row);
    const Rows mine = by_scene(found.rows).back();
    if (alike(run->row, mine.front(), {"friction", "restitution", "dt_s"}))
      found.courses.push_back({run->row, std::move(run->history)});
    write_json(request.out + "/results.json", found.rows);
    progress.after(found.rows.back());
  }
}

void run_costs(const EnginePlan& plan, EngineFindings& found) {
  TimeLeft left(static_cast<double>(plan.costs.size()));
  double done = 0.0;
  for (const auto& [engine, preset] : plan.costs) {
    if (stop_signal() != 0) return;
    const Rows rows = body_costs(engine, preset, [](const Json& row) {
      fmt::print("figure 12: {} {}, {} {} bodies, {:.0f} contacts: {:.3g} ms, p99 {:.3g} ms\n",
                 row.at("engine").get<std::string>(), row.at("preset").get<std::string>(), row.at("bodies").dump(),
                 row.at("arrangement").get<std::string>(), number(row, "contacts_mean"),
                 1e3 * number(row.at("step_s"), "mean"), 1e3 * number(row.at("step_s"), "p99"));
      std::fflush(stdout);
    });
    found.costs.insert(found.costs.end(), rows.begin(), rows.end());
    if (stop_signal() != 0) return;
    fmt::print("figure 12: {} {} done{}\n", engine, preset, left.text(++done));
  }
}

int run_lab(int argc, char** argv) {
  const auto again = [](const std::string& folder, const std::string& page) {
    write_report(page, saved_engine_runs(folder));
  };
  if (const auto code = report_again(argc, argv, again)) return *code;
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const EnginePlan plan = plan_of(request);
  const std::string& out = request.out;
  open_results("engines", out);
  make_folder(out + "/histories");
  if (request.states) make_folder(out + "/states");
  watch_stop_signals();
  fmt::print("subworld lab engines: {} runs{}, results in {}\n", plan.points.size(),
             plan.costs.empty() ? "" : " and figure 12", out);
  std::fflush(stdout);

  EngineFindings found;
  run_points(request, plan, found);
  run_costs(plan, found);
  found.summary = engine_summary(plan, request.sweep, found);
  if (!found.costs.empty()) {
    write_csv(out + "/bodies.csv", found.costs);
    write_json(out + "/bodies.json", found.costs);
  }
  for (const Json& line : found.summary.at("advice")) fmt::print("{}\n", line.get<std::string>());
  return end_lab(out, found.rows, found.summary, [&](const std::string& page) { write_report(page, found); });
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab engines", [&] { return run_lab(argc, argv); });
}
