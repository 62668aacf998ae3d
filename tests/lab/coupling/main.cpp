#include "coupling/plan.hpp"
#include "coupling/schemes/scheme.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "io/results/replacing.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/coupling/mutual.hpp"
#include "lab/coupling/report.hpp"
#include "lab/coupling/saved.hpp"
#include "lab/coupling/sweep.hpp"
#include "lab/page/command_line.hpp"
#include "lab/session/variants.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>

namespace {

using namespace subworld;

constexpr std::size_t kMostTraces = 64;
constexpr double kQuickDuration_s = 1.0;
const std::vector<std::string> kScenes{"row",   "press",   "scatter", "raft",    "hidden_load", "heavy_outside",
                                       "slope", "pyramid", "see_saw", "leaning", "loose",       "tower_press"};
const std::vector<std::string> kQuickScenes{"row", "press"};
const std::vector<int> kQuickRatios{4, 20};

/// Settings whose short forms are axes.
constexpr std::array kAxes{"world.engine", "haptic.engine", "passivity", "delay.latency_s"};

struct Request {
  Sweep sweep;
  std::array<std::vector<std::string>, kAxes.size()> axes;
  std::vector<std::string> set;
  int variants = 0;
  bool mutual = false;
  bool quick = false;
  std::string out;
};

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  Sweep& sweep = request.sweep;
  CommandLine line("subworld lab coupling",
                   "Measures the error that each coupling scheme adds to the felt force, against a reference without "
                   "coupling, and its cost. Every combination of the options is run; an option takes a list, separated "
                   "by commas.");
  line.footer(
      "Examples:\n"
      "  subworld lab coupling --quick --out out/quick\n"
      "  subworld lab coupling row --ratio 1,4,10,20 --out out/row\n"
      "  subworld lab coupling row heavy_outside --scheme reduced --set users.box_half_m=0.15,0.2,0.3 --substeps 1,4\n"
      "  subworld lab coupling raft pyramid --variants 10 --ratio 4,10\n"
      "  subworld lab coupling row --latency 0,0.02,0.1 --set delay.jitter_s=0,0.01\n"
      "  subworld lab coupling lift --ratio 4 --latency 0.05 --set delay.loss_ratio=0,0.05 --passivity on,off\n"
      "DIR/report.html shows the results, DIR/results.csv and results.json hold them, DIR/users.csv those\n"
      "of each user, DIR/traces the felt forces.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.");
  const std::string scenes = "the scene's";
  line.add("scene", &sweep.scenes, "scene files, or names of scenes of Subworld").otherwise(joined(kScenes, " "));
  line.add("--scheme", &sweep.schemes,
           "coupling schemes; in paper_literal the device's force acts in the sub-world alone")
      .one_of({"direct", "paper", "paper_literal", "reduced"});
  const Option ratio = line.add("--ratio", &sweep.ratios, "simulation ratios r = T / h").check(fixed_ratio_fault);
  line.add(
          "--ratio-most", &sweep.ratios_most,
          "the ratio may rise to this value where nothing that crosses a border is felt, or where the world costs more "
          "than a cycle by its engine's published costs; 0: it is fixed")
      .range(0, kMostRatio);
  line.add("--substeps", &sweep.substeps, "the world's sub-steps per cycle; 0: as the scheme requests").range(0, 1000);
  line.add("--oracle", &sweep.oracle,
           "on: the sub-worlds know the motion of the other users' devices without delay, in schemes that use it; what "
           "is left of an error is not one of prediction")
      .one_of({"on", "off"});
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    const Setting& setting = *find_setting(kAxes[i]);
    line.add(std::string(setting.option), &request.axes[i], std::string(setting.meaning))
        .check([&setting](const std::string& text) {
          return setting_fault({setting.key, text});
        })
        .otherwise(setting.member == nullptr ? "0" : scenes);
  }
  line.add("--set", &request.set,
           "KEY=V1,V2,...: values of any setting, by its key in the scene file, as in deadband=0,0.1 or "
           "users.box_half_m=0.2,0.3; `subworld plan SCENE --settings` lists all; may be repeated")
      .whole()
      .check(axis_fault)
      .otherwise("the scene's, but no delay and no deadband");
  line.add("--stiffness", &sweep.stiffness_factors, "factors on the coupling's stiffness").range(1e-3, 1e3);
  line.add("--h", &sweep.h_s, "haptic steps").range(1e-5, 0.1, "s").otherwise(scenes);
  line.add("--variants", &request.variants,
           "number of variants of each scene, with other friction, masses and paths: whether an error is that of one "
           "lucky scene")
      .range(0, 1000);
  line.flag("--mutual", request.mutual,
            "also measures how late each user feels the motion of the others, for DIR/users.csv: a run more for each "
            "user and point");
  add_duration(line, sweep.duration_s);
  line.flag("--quick", request.quick,
            fmt::format("a first look: scenes {}, ratios {}, {:g} s, where nothing else is given",
                        joined(kQuickScenes, " "), joined(kQuickRatios, ","), kQuickDuration_s));
  add_out(line, "coupling", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    if (!request.axes[i].empty()) sweep.settings.push_back({kAxes[i], request.axes[i]});
  }
  for (const std::string& text : request.set) sweep.settings.push_back(parse_axis(text));
  for (int v = 1; v <= request.variants; ++v) sweep.variants.push_back(v);
  if (request.quick && !ratio.given()) sweep.ratios = kQuickRatios;
  if (request.quick && !sweep.duration_s) sweep.duration_s = kQuickDuration_s;
  if (sweep.scenes.empty()) sweep.scenes = scene_files(request.quick ? kQuickScenes : kScenes);
  for (std::string& scene : sweep.scenes) scene = scene_file(scene);
  if (request.out.empty()) request.out = default_out("coupling");
  return std::nullopt;
}

Json engine_settings(const EngineSettings& e) {
  return {{"engine", e.name}, {"preset", e.preset}, {"iterations", e.iterations ? Json(*e.iterations) : Json(nullptr)}};
}

Json effective(const Scene& scene) {
  const Settings& s = scene.settings;
  const UserSpec& user = scene.users.front();
  return {{"scene", scene.name},
          {"file", scene.file},
          {"h_s", s.h_s},
          {"duration_s", s.duration_s},
          {"settle_s", s.settle_s},
          {"bodies", scene.bodies.size()},
          {"users", s.users},
          {"box_m", user.box_half_m},
          {"contact_depth", user.contact_depth},
          {"budget_ratio", user.budget_ratio},
          {"coupling_stiffness_n_m", user.coupling.stiffness_n_m},
          {"coupling_damping_n_s_m", user.coupling.damping_n_s_m},
          {"world", engine_settings(s.world)},
          {"haptic", engine_settings(s.haptic)}};
}

Json asked(const Sweep& s) {
  Json json{{"variant", s.variants},
            {"scheme", s.schemes},
            {"ratio", s.ratios},
            {"ratio_most", s.ratios_most},
            {"world_substeps", s.substeps},
            {"oracle", s.oracle},
            {"stiffness_factor", s.stiffness_factors},
            {"h_s", s.h_s}};
  for (const SettingAxis& axis : s.settings) json[column_of(axis.key)] = axis.values;
  return json;
}

std::string verdict_of(const Rows& rows, std::size_t planned) {
  const auto count = [&](const auto& holds) { return std::ranges::count_if(rows, holds); };
  std::string verdict =
      fmt::format("{} points: {} imperceptible, {} at their reference error, {} did not survive", rows.size(),
                  count(imperceptible), count([](const Json& row) { return row.at("at_reference_error").get<bool>(); }),
                  count([](const Json& row) { return !row.at("survived").get<bool>(); }));
  return verdict + stopped_text(rows.size(), planned);
}

/// Prints one line for each point, with the estimated remaining time.
class Progress {
 public:
  Progress(std::size_t points, const Sweep& sweep) : points_(points), left_(static_cast<double>(points)) {
    const auto add = [&](const std::string& column, std::size_t values) {
      if (values > 1) columns_.push_back(column);
    };
    add("variant", sweep.variants.size());
    add("h_s", sweep.h_s.size());
    add("coupling_stiffness_n_m", sweep.stiffness_factors.size());
    add("world_substeps", sweep.substeps.size());
    add("oracle", sweep.oracle.size());
    add("ratio_most", sweep.ratios_most.size());
    for (const SettingAxis& axis : sweep.settings) add(column_of(axis.key), axis.values.size());
  }
  void operator()(const Rows& rows) {
    const Json& row = rows.back();
    const auto percent = [&](const char* column) {
      const double part = row.at(column).get<double>();
      return std::isfinite(part) ? fmt::format("{:6.2f} %", 100.0 * part) : "unknown";
    };
    const bool bounded = number(row, "causal_error") > 0.0;
    fmt::print("[{:3}/{}] {:<13} {:<13} r={:<3} {:<32} rms {} (reference error {}{}){}{}  {:.3g} CPU s/s{}\n",
               rows.size(), points_, row.at("scene").get<std::string>(), row.at("scheme").get<std::string>(),
               row.at("ratio").get<int>(), swept_text(row, columns_, ""),
               !row.at("survived").get<bool>() ? "did not survive"
               : comparable(row)               ? percent("force_error_rms")
                                               : "unknown, the reference felt no force",
               percent("reference_error"), bounded ? ", causal error " + percent("causal_error") : "",
               row.at("at_reference_error").get<bool>() ? ", not significant" : "",
               at_causal_bound(row) ? ", at the bound" : "", total_cpu(row),
               left_.text(static_cast<double>(rows.size())));
    std::fflush(stdout);
  }

 private:
  std::size_t points_;
  std::vector<std::string> columns_;  ///< with several values
  TimeLeft left_;
};

Findings sweep_all(const Request& request, const std::vector<Point>& points) {
  const Sweep& sweep = request.sweep;
  const std::string& out = request.out;
  Findings found;
  References references;
  MutualLatencies mutual;
  Progress progress(points.size(), sweep);
  for (const Point& point : points) {
    std::optional<Measured> measured = measure(point, references, request.mutual ? &mutual : nullptr);
    if (!measured) break;
    found.rows.push_back(std::move(measured->row));
    std::ranges::move(measured->users, std::back_inserter(found.users));
    for (Trace& trace : measured->traces) {
      if (!shown(point, sweep) || found.traces.size() == kMostTraces) break;
      write_trace(out, trace);
      found.traces.push_back(std::move(trace));
    }
    write_json(out + "/results.json", found.rows);
    progress(found.rows);
  }
  return found;
}

Json summary_of(const Request& request, const Findings& found, std::size_t planned) {
  Json summary = begin_summary("coupling", found.rows.size(), planned);
  summary["sweep"] = asked(request.sweep);
  summary["scenes"] = Json::array();
  for (const std::string& scene : request.sweep.scenes) {
    Point point;
    point.scene = scene;
    point.duration_s = request.sweep.duration_s;
    summary["scenes"].push_back(effective(reference_scene_of(point)));
    point.scheme = request.sweep.schemes.front();
    summary["scenes"].back()["plan"] = to_json(plan_of(scene_of(point)));
  }
  summary["traces"] = traces_json(found.traces);
  Json fits = convergence(found.rows, "ratio");
  if (request.sweep.h_s.size() > 1) {
    for (Json& fit : convergence(found.rows, "h_s")) fits.push_back(std::move(fit));
  }
  summary["convergence"] = fits;
  summary["over_variants"] = over_variants(found.rows);
  summary["variants"] = Json::array();
  for (const int variant : request.sweep.variants) {
    const Variation v = variation(variant);
    summary["variants"].push_back({{"variant", variant},
                                   {"friction_factor", v.friction},
                                   {"mass_factor", v.mass},
                                   {"turn_rad", Eigen::AngleAxisd(v.turn).angle()},
                                   {"stretch_factor", v.stretch},
                                   {"aside", v.aside}});
  }
  summary["verdict"] = verdict_of(found.rows, planned);
  return summary;
}

void print_findings(const Findings& found) {
  for (const Rows& rows : by_scene(found.rows)) {
    const std::string scene = rows.front().at("scene");
    for (const std::string& line : orders_of(found.summary.at("convergence"), rows))
      fmt::print("order, {}: {}\n", scene, line);
    for (const std::string& line : variants_of(found.summary.at("over_variants"), rows))
      fmt::print("variants, {}: {}\n", scene, line);
  }
}

int run_lab(int argc, char** argv) {
  const auto again = [](const std::string& folder, const std::string& page) {
    write_report(page, saved_sweep(folder));
  };
  if (const auto code = report_again(argc, argv, again)) return *code;
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const std::vector<Point> points = points_of(request.sweep);
  for (const Point& point : points) {
    if (point.ratio == request.sweep.ratios.front()) (void)scene_of(point);
  }
  const std::string& out = request.out;
  open_results("coupling", out);
  make_folder(out + "/traces");
  for (const auto& old : std::filesystem::directory_iterator(out + "/traces")) {
    if (old.path().extension() == ".csv" && is_result(old.path())) std::filesystem::remove(old.path());
  }
  watch_stop_signals();
  fmt::print("subworld lab coupling: {} points, results in {}\n", points.size(), out);
  std::fflush(stdout);

  Findings found = sweep_all(request, points);
  found.summary = summary_of(request, found, points.size());
  write_csv(out + "/users.csv", found.users);
  write_json(out + "/users.json", found.users);
  print_findings(found);
  return end_lab(out, found.rows, found.summary, [&](const std::string& page) { write_report(page, found); });
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab coupling", [&] { return run_lab(argc, argv); });
}
