#include "coupling/plan.hpp"
#include "coupling/scheme.hpp"
#include "io/command_line.hpp"
#include "io/options.hpp"
#include "io/scene_name.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/coupling/mutual.hpp"
#include "lab/coupling/report.hpp"
#include "lab/coupling/saved.hpp"
#include "lab/coupling/sweep.hpp"
#include "lab/page/command_line.hpp"
#include "lab/session/variants.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>
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

struct Request {
  Sweep sweep;
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
      "  subworld lab coupling row heavy_outside --scheme reduced --box 0.15,0.2,0.3 --substeps 1,4\n"
      "  subworld lab coupling raft pyramid --variants 10 --ratio 4,10\n"
      "  subworld lab coupling deploy/scenes/row.yaml --latency 0,0.02,0.1 --jitter 0,0.01\n"
      "  subworld lab coupling lift --ratio 4 --latency 0.05 --loss 0,0.05 --passivity on,off\n"
      "DIR/report.html shows the results, DIR/results.csv and results.json hold them, DIR/users.csv those\n"
      "of each user, DIR/traces the felt forces.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.");
  const std::string scenes = "the scene's";
  line.add("scene", &sweep.scenes, "scene files, or names in deploy/scenes")
      .otherwise(fmt::format("{}", fmt::join(kScenes, " ")));
  line.add("--scheme", &sweep.schemes,
           "coupling schemes; in paper_literal the device's force acts in the sub-world alone")
      .one_of({"direct", "paper", "paper_literal", "reduced"});
  const Option ratio = line.add("--ratio", &sweep.ratios, "simulation ratios r = T / h").check(fixed_ratio_fault);
  line.add(
          "--ratio-most", &sweep.ratios_most,
          "the ratio may rise to this value where nothing that crosses a border is felt, or where the world costs more "
          "than a cycle by its engine's published costs; 0: it is fixed")
      .range(0, kMostRatio);
  line.add("--box", &sweep.boxes_m, "half sides of the box around the proxy").range(1e-3, 1e3, "m").otherwise(scenes);
  line.add("--depth", &sweep.contact_depths,
           "bodies that this many contacts connect to the proxy belong to the sub-world too")
      .range(0, 1000)
      .otherwise(scenes);
  line.add("--budget", &sweep.budget_ratios,
           "parts of the haptic step that the step of the sub-world may take; of the box's bodies, those that matter "
           "most and fit are simulated")
      .range(1e-3, 1e3)
      .otherwise(scenes);
  line.add("--substeps", &sweep.substeps, "the world's sub-steps per cycle; 0: as the scheme requests").range(0, 1000);
  line.add("--latency", &sweep.latencies_s, "delays added to the round trip, half each way").range(0.0, 10.0, "s");
  line.add("--jitter", &sweep.jitters_s, "longest extra delays of a single message").range(0.0, 10.0, "s");
  line.add("--device-latency", &sweep.device_latencies_s,
           "delays added to the round trip between device and sub-world, half each way")
      .range(0.0, 2.0, "s");
  line.add("--loss", &sweep.loss_ratios,
           "parts of the messages that are lost; between world and sub-world they are sent again and arrive late, on "
           "the device's link the newest that arrived counts")
      .range(0.0, 0.9, kPartUnit);
  line.add("--deadband", &sweep.deadbands,
           "Weber fractions of the link of a device: samples are not sent that an operator cannot tell from their "
           "extrapolation")
      .range(0.0, kMostDeadband, kPartUnit);
  line.add("--passivity", &sweep.passivities,
           "the bound on the energy that a device gives to its operator: on, off, or automatic (on where messages are "
           "delayed or lost)")
      .one_of({"on", "off", "automatic"})
      .otherwise(scenes);
  line.add("--stiffness", &sweep.stiffness_factors, "factors on the coupling's stiffness").range(1e-3, 1e3);
  line.add("--h", &sweep.h_s, "haptic steps").range(1e-5, 0.1, "s").otherwise(scenes);
  line.add("--engine", &sweep.engines, "the world's engines").otherwise(scenes);
  line.add("--haptic-engine", &sweep.haptic_engines, "the sub-worlds' engines").otherwise(scenes);
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
                        fmt::join(kQuickScenes, " "), fmt::join(kQuickRatios, ","), kQuickDuration_s));
  add_out(line, "coupling", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
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
  return {{"variant", s.variants},
          {"scheme", s.schemes},
          {"engine", s.engines},
          {"haptic_engine", s.haptic_engines},
          {"ratio", s.ratios},
          {"ratio_most", s.ratios_most},
          {"box_m", s.boxes_m},
          {"contact_depth", s.contact_depths},
          {"budget_ratio", s.budget_ratios},
          {"world_substeps", s.substeps},
          {"latency_s", s.latencies_s},
          {"jitter_s", s.jitters_s},
          {"device_latency_s", s.device_latencies_s},
          {"loss_ratio", s.loss_ratios},
          {"deadband", s.deadbands},
          {"passivity", s.passivities},
          {"stiffness_factor", s.stiffness_factors},
          {"h_s", s.h_s}};
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
  Progress(std::size_t points, const Sweep& sweep)
      : points_(points), sweep_(sweep), left_(static_cast<double>(points)) {}
  void operator()(const Rows& rows) {
    const Json& row = rows.back();
    const auto percent = [&](const char* column) {
      const double part = row.at(column).get<double>();
      return std::isfinite(part) ? fmt::format("{:6.2f} %", 100.0 * part) : "unknown";
    };
    fmt::print("[{:3}/{}] {:<13} {:<13} r={:<3} {:<32} rms {} (reference error {}){}  {:.3g} CPU s/s{}\n", rows.size(),
               points_, row.at("scene").get<std::string>(), row.at("scheme").get<std::string>(),
               row.at("ratio").get<int>(), details(row),
               !row.at("survived").get<bool>() ? "did not survive"
               : comparable(row)               ? percent("force_error_rms")
                                               : "unknown, the reference felt no force",
               percent("reference_error"), row.at("at_reference_error").get<bool>() ? ", not significant" : "",
               total_cpu(row), left_.text(static_cast<double>(rows.size())));
    std::fflush(stdout);
  }

 private:
  std::string details(const Json& row) const {
    std::string text = fmt::format("box {:g} m", row.at("box_m").get<double>());
    if (const int variant = row.at("variant"); variant != 0) text += fmt::format(", variant {}", variant);
    if (sweep_.h_s.size() > 1) text += fmt::format(", h {:g} ms", 1e3 * row.at("h_s").get<double>());
    if (sweep_.stiffness_factors.size() > 1)
      text += fmt::format(", K {:g} N/m", row.at("coupling_stiffness_n_m").get<double>());
    if (sweep_.engines.size() > 1 || sweep_.haptic_engines.size() > 1)
      text +=
          fmt::format(", {} with {}", row.at("engine").get<std::string>(), row.at("haptic_engine").get<std::string>());
    if (row.at("contact_depth") != 0) text += fmt::format(", depth {}", row.at("contact_depth").get<int>());
    if (sweep_.budget_ratios.size() > 1)
      text += fmt::format(", budget {:g} %, {:.1f} members", 100.0 * row.at("budget_ratio").get<double>(),
                          row.at("members_mean").get<double>());
    if (row.at("world_substeps") != 1) text += fmt::format(", {} sub-steps", row.at("world_substeps").get<int>());
    for (const auto& [column, name] :
         {std::pair{"latency_s", "latency"}, {"jitter_s", "jitter"}, {"device_latency_s", "device latency"}}) {
      if (const double s = row.at(column).get<double>(); s > 0.0) text += fmt::format(", {} {:g} ms", name, 1e3 * s);
    }
    if (const double loss = row.at("loss_ratio").get<double>(); loss > 0.0)
      text += fmt::format(", loss {:g} %", 1e2 * loss);
    if (const double p = row.at("deadband").get<double>(); p > 0.0)
      text += fmt::format(", deadband {:g} %: {:.0f} % of the samples", 1e2 * p,
                          1e2 * row.at("device_sent_ratio").get<double>());
    if (sweep_.passivities.size() > 1) text += fmt::format(", passivity {}", row.at("passivity").get<std::string>());
    return text;
  }

  std::size_t points_;
  const Sweep& sweep_;
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
  make_folder(out + "/traces");
  for (const auto& old : std::filesystem::directory_iterator(out + "/traces")) {
    if (old.path().extension() == ".csv") std::filesystem::remove(old.path());
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
