#include "io/options.hpp"
#include "lab/command_line.hpp"
#include "lab/engine_report.hpp"
#include "lab/engine_sweep.hpp"
#include "model/error.hpp"
#include "physics/plugin.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>

namespace {

using namespace subworld;

constexpr double kQuickDuration_s = 1.0;
constexpr double kNews_s = 30.0;  ///< a run that takes longer says how far it is
const std::vector<std::string> kScenes{"stack", "card_house", "basin"};
const std::vector<std::string> kQuickScenes{"stack", "card_house"};

struct Request {
  EngineSweep sweep;
  std::vector<std::string> steps;  ///< as written
  bool costs = false;              ///< figure 12
  bool states = false;
  std::string out;
};

/// Throws `Error` (usage). An exit code where nothing is left to do.
std::optional<int> parse(int argc, char** argv, Request& request) {
  EngineSweep& sweep = request.sweep;
  CLI::App app{
      "Judges the physics engines alone, without any coupling: what a step costs, and whether structures stand. "
      "Every combination of the options is run; each option is a list, separated by commas.",
      "subworld lab engines"};
  app.footer(fmt::format(
      "Without --friction, --restitution and --dt the five combinations of the paper's Table 1 are run (friction 0.5,\n"
      "0.5, 0.5, 1, 0; restitution 0.4, 0, 0.4, 0.4, 0.4; dt 1/60, 1/60, 1/100, 1/60, 1/60), and structures at finer\n"
      "steps too. {}\n\n"
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
      kHeldInWords, fmt::join(in_display_order(engine_names()), ",")));
  app.add_option("scene", sweep.scenes,
                 fmt::format("scene files, or names in deploy/scenes (default: {})", fmt::join(kScenes, " ")));
  add_list(app, "--engine", sweep.engines, "engines (default: all there are)");
  add_list(app, "--preset", sweep.presets,
           "presets of the engines (default: all for a structure, the first for a scene that falls)");
  add_list(app, "--dt", request.steps, "time steps, s, as in 1/60 or 0.01 (default: Table 1)");
  add_numbers(app, "--friction", sweep.frictions, "friction coefficients of each pair (default: Table 1)", 0.0, 10.0);
  add_numbers(app, "--restitution", sweep.restitutions, "restitution of each pair (default: Table 1)", 0.0, 1.0);
  CLI::Option* duration = app.add_option("--duration", sweep.duration_s, "simulated time, s (default: 10)");
  duration->check(CLI::Range(0.01, 1e4))->check(not_finite);
  CLI::Option* costs =
      app.add_flag("--figure12", request.costs,
                   "step time against the number of bodies; alone: no scenes (a run without scenes and "
                   "without --quick has it anyway)");
  app.add_flag("--states", request.states, "also the states of all bodies over time, in DIR/states");
  app.add_flag("--quick", sweep.quick,
               fmt::format("a first look: scenes {}, two combinations, {:g} s, where nothing else is asked",
                           fmt::join(kQuickScenes, " "), kQuickDuration_s));
  add_out(app, "engines", request.out);
  if (const auto code = parse_lab(app, argc, argv)) return code;

  for (const std::string& step : request.steps) sweep.steps_s.push_back(step_of(step));
  if (sweep.quick && duration->count() == 0) sweep.duration_s = kQuickDuration_s;
  if (sweep.scenes.empty() && (costs->count() == 0 || sweep.quick))
    sweep.scenes = scene_files(sweep.quick ? kQuickScenes : kScenes), request.costs |= !sweep.quick;
  for (std::string& scene : sweep.scenes) scene = scene_file(scene);
  if (sweep.engines.empty()) sweep.engines = engine_names();
  sweep.engines = in_display_order(sweep.engines);
  if (request.out.empty()) request.out = default_out("engines");
  return std::nullopt;
}

/// What is measured, engine by engine: the rows of the scenes first, then figure 12.
struct Plan {
  std::deque<LabScene> scenes;
  std::vector<EnginePoint> points;
  std::vector<std::pair<std::string, std::string>> costs;  ///< engine and preset

  /// Body steps, as a measure of the time that a run takes.
  [[nodiscard]] static double work(const EnginePoint& point) {
    return point.steps() * static_cast<double>(point.scene->scene.bodies.size());
  }
};

Plan plan_of(const Request& request) {
  Plan plan;
  for (const std::string& file : request.sweep.scenes) plan.scenes.push_back(load_lab_scene(file));
  plan.points = points_of(request.sweep, plan.scenes);
  for (const std::string& engine : request.sweep.engines) {
    for (const std::string& preset : presets_of(request.sweep, engine, SceneKind::fall)) {
      if (request.costs) plan.costs.emplace_back(engine, preset);
    }
  }
  return plan;
}

/// A line for each run, with the time that the rest may take; more where one takes long.
class Progress {
 public:
  explicit Progress(const std::vector<EnginePoint>& points) : count_(points.size()), left_(total(points)) {}
  void during(const EnginePoint& point, double t_s) {
    const Clock::time_point now = Clock::now();
    if (now - news_ < std::chrono::duration<double>(kNews_s)) return;
    say(fmt::format("          {} {} {}: {:.3g} of {:g} s{}", point.scene->scene.name, point.engine, point.preset, t_s,
                    point.duration_s, left_.text(done_ + Plan::work(point) * t_s / point.duration_s)));
  }
  void after(const EnginePoint& point, const Json& row) {
    done_ += Plan::work(point);
    const Json& step = row.at("step_s");
    const bool held = row.at("held").get<bool>();
    say(fmt::format("[{:3}/{}] {:<12} {:<20} {:<42} step {:8.3g} ms, max {:8.3g} ms  {}{}", ++number_, count_,
                    point.scene->scene.name, point.engine + " " + point.preset, combination_text(row),
                    1e3 * number(step, "mean"), 1e3 * number(step, "max"),
                    row.at("failure") != "" ? "failed: " + row.at("failure").get<std::string>()
                    : held                  ? "held"
                                            : fmt::format("lost at {:.2g} s", number(row, "fell_at_s")),
                    left_.text(done_)));
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double total(const std::vector<EnginePoint>& points) {
    double work = 0.0;
    for (const EnginePoint& point : points) work += Plan::work(point);
    return work;
  }
  void say(const std::string& line) {
    fmt::print("{}\n", line);
    std::fflush(stdout);
    news_ = Clock::now();
  }
  std::size_t count_;
  std::size_t number_ = 0;
  double done_ = 0.0;
  TimeLeft left_;
  Clock::time_point news_ = Clock::now();
};

void run_points(const Request& request, const Plan& plan, EngineFindings& found) {
  Progress progress(plan.points);
  for (const EnginePoint& point : plan.points) {
    const std::string states =
        request.states ? fmt::format("{}/states/{}.csv", request.out, point.file_name()) : std::string();
    std::optional<EngineRun> run = run_engine(point, states, [&](double t_s) { progress.during(point, t_s); });
    if (!run) return;
    write_csv(fmt::format("{}/histories/{}.csv", request.out, point.file_name()), run->history);
    found.rows.push_back(run->row);
    const Rows mine = by_scene(found.rows).back();
    if (alike(run->row, mine.front(), {"friction", "restitution", "dt_s"}))
      found.courses.push_back({run->row, std::move(run->history)});
    write_json(request.out + "/results.json", found.rows);
    progress.after(point, found.rows.back());
  }
}

void run_costs(const Plan& plan, EngineFindings& found) {
  TimeLeft left(static_cast<double>(plan.costs.size()));
  double done = 0.0;
  for (const auto& [engine, preset] : plan.costs) {
    if (stop_signal() != 0) return;
    const auto rows = body_costs(engine, preset, [](const Json& row) {
      fmt::print("figure 12: {} {}, {} {} bodies, {:.0f} contacts: {:.3g} ms, p99 {:.3g} ms\n",
                 row.at("engine").get<std::string>(), row.at("preset").get<std::string>(), row.at("bodies").dump(),
                 row.at("arrangement").get<std::string>(), number(row, "contacts_mean"),
                 1e3 * number(row.at("step_s"), "mean"), 1e3 * number(row.at("step_s"), "p99"));
      std::fflush(stdout);
    });
    if (!rows) return;
    found.costs.insert(found.costs.end(), rows->begin(), rows->end());
    fmt::print("figure 12: {} {} done{}\n", engine, preset, left.text(++done));
  }
}

Json engines_json(const std::vector<std::string>& engines) {
  Json all = Json::array();
  for (const std::string& name : engines) {
    const EnginePlugin& plugin = engine_plugin(name);
    Json presets = Json::object();
    for (const EnginePreset& preset : plugin.presets) presets[std::string(preset.name)] = preset.what;
    all.push_back(
        {{"engine", plugin.name}, {"version", plugin.version}, {"licence", plugin.licence}, {"presets", presets}});
  }
  return all;
}

Json grades_json(const Rows& rows) {
  Json grades = Json::array();
  for (const Rows& scene : by_scene(rows)) {
    if (scene.front().at("kind") != "structure") continue;
    for (const Variant& variant : variants_of(scene)) {
      grades.push_back({{"scene", scene.front().at("scene")},
                        {"engine", variant.engine},
                        {"preset", variant.preset},
                        {"grade", grade(variant)}});
    }
  }
  return grades;
}

Json fits_json(const Rows& costs) {
  const auto line = [](const LineFit& fit) {
    return Json{{"slope_s", fit.slope()}, {"standard_error_s", fit.standard_error()}, {"r_squared", fit.r_squared()}};
  };
  Json fits = Json::array();
  for (const CostCurve& curve : curves_of(costs)) {
    Json fit{{"arrangement", curve.arrangement}, {"engine", curve.engine}, {"preset", curve.preset}};
    fit["per_body"] = line(per_body(curve));
    fit["per_contact"] = curve.arrangement == kDense ? line(per_contact(curve)) : Json(nullptr);
    for (const double period_s : kPeriods_s) {
      const std::string key = fmt::format("bodies_in_{:g}_ms", 1e3 * period_s);
      fit[key] = {{"mean", largest(curve, period_s, "mean").text()}, {"p99", largest(curve, period_s, "p99").text()}};
    }
    fits.push_back(fit);
  }
  return fits;
}

Json summary_of(const Plan& plan, const Request& request, const EngineFindings& found) {
  Json summary = begin_summary("engines", found.rows.size(), plan.points.size());
  summary["engines"] = engines_json(request.sweep.engines);
  std::vector<std::string> about;
  summary["scenes"] = Json::array();
  for (const LabScene& scene : plan.scenes) {
    const bool structure = scene.kind == SceneKind::structure;
    summary["scenes"].push_back(
        {{"scene", scene.scene.name}, {"file", scene.scene.file}, {"kind", structure ? "structure" : "fall"}});
    about.push_back(scene.scene.name);
  }
  std::string engines;
  for (const Json& engine : summary.at("engines"))
    engines += fmt::format("{}{} ({})", engines.empty() ? "" : ", ", engine.at("engine").get<std::string>(),
                           engine.at("version").get<std::string>());
  summary["about"] = fmt::format("Engines: {}. Scenes: {}.", engines, fmt::join(about, ", "));
  summary["duration_s"] = request.sweep.duration_s;
  summary["held_means"] = kHeldInWords;
  summary["grade_means"] = kGradesInWords;
  summary["grades"] = grades_json(found.rows);
  summary["figure12"] = fits_json(found.costs);
  summary["advice"] = advice(found.rows, found.costs);
  const auto count = [&](const auto& holds) { return std::ranges::count_if(found.rows, holds); };
  summary["verdict"] = fmt::format("{} runs: {} held, {} failed{}", found.rows.size(),
                                   count([](const Json& row) { return row.at("held").get<bool>(); }),
                                   count([](const Json& row) { return row.at("failure") != ""; }),
                                   stopped_text(found.rows.size(), plan.points.size()));
  return summary;
}

int run_lab(int argc, char** argv) {
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const Plan plan = plan_of(request);
  const std::string& out = request.out;
  make_folder(out + "/histories");
  if (request.states) make_folder(out + "/states");
  watch_stop_signals();
  fmt::print("subworld lab engines: {} runs{}, results in {}\n", plan.points.size(),
             plan.costs.empty() ? "" : " and figure 12", out);
  std::fflush(stdout);

  EngineFindings found;
  run_points(request, plan, found);
  run_costs(plan, found);
  found.summary = summary_of(plan, request, found);
  write_json(out + "/results.json", found.rows);
  write_csv(out + "/results.csv", found.rows);
  if (!found.costs.empty()) write_csv(out + "/bodies.csv", found.costs);
  write_json(out + "/summary.json", found.summary);
  for (const Json& line : found.summary.at("advice")) fmt::print("for {}\n", line.get<std::string>());
  print_end(found.summary, out);
  write_report(out + "/report.html", found);
  fmt::print("report: {}/report.html\n", out);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab engines", [&] { return run_lab(argc, argv); });
}
