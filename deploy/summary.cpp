#include "summary.hpp"

#include "coupling/plan.hpp"
#include "gates.hpp"
#include "io/version.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

namespace {

Json describe(const EngineSettings& engine) {
  const EnginePlugin& plugin = engine_plugin(engine.name);
  Json json{{"name", engine.name},
            {"version", plugin.version},
            {"preset", engine.preset},
            {"length_unit_m", engine.length_unit_m},
            {"gravity_m_s2", {engine.gravity.x(), engine.gravity.y(), engine.gravity.z()}}};
  const auto preset = std::ranges::find(plugin.presets, engine.preset, &EnginePreset::name);
  if (preset != plugin.presets.end()) json["preset_means"] = preset->what;
  if (engine.iterations) json["iterations"] = *engine.iterations;
  if (engine.substeps) json["substeps"] = *engine.substeps;
  if (engine.longest_substep_s) json["longest_substep_s"] = *engine.longest_substep_s;
  return json;
}

constexpr std::array kSelections{"box", "contacts", "budget"};  ///< in the order of Selection

Json describe(const UserSpec& user) {
  const CouplingSettings& c = user.coupling;
  const DeviceSpec& d = user.device;
  Json json{{"name", user.name},
            {"selection",
             {{"by", kSelections[static_cast<std::size_t>(user.selection)]},
              {"box_half_m", user.box_half_m},
              {"contact_depth", user.contact_depth},
              {"budget_ratio", user.budget_ratio}}},
            {"coupling",
             {{"stiffness_n_m", c.stiffness_n_m},
              {"damping_n_s_m", c.damping_n_s_m},
              {"rotational_stiffness_n_m", c.rotational_stiffness_n_m},
              {"rotational_damping_n_m_s", c.rotational_damping_n_m_s},
              {"ramp_s", c.ramp_s}}},
            {"device",
             {{"kind", d.kind == DeviceKind::impedance ? "impedance" : "admittance"},
              {"degrees_of_freedom", d.degrees_of_freedom},
              {"rate_hz", d.rate_hz},
              {"force_limit_n", d.force_limit_n},
              {"torque_limit_n_m", d.torque_limit_n_m},
              {"force_rate_limit_n_s", d.force_rate_limit_n_s.value_or(d.force_limit_n / DeviceSpec::kFullScale_s)},
              {"power_limit_w", d.power_limit_w.value_or(d.force_limit_n * DeviceSpec::kFastestPush_m_s)},
              {"speed_limit_m_s", d.speed_limit_m_s},
              {"mass_kg", d.mass_kg},
              {"damping_n_s_m", d.damping_n_s_m},
              {"friction_n", d.friction_n},
              {"position_resolution_m", d.position_resolution_m},
              {"path_segments", d.path.size()}}}};
  if (d.operator_model) {
    json["device"]["operator"] = {{"mass_kg", d.operator_model->mass_kg},
                                  {"damping_n_s_m", d.operator_model->damping_n_s_m},
                                  {"stiffness_n_m", d.operator_model->stiffness_n_m},
                                  {"inertia_kg_m2", d.operator_model->inertia_kg_m2},
                                  {"rotational_damping_n_m_s", d.operator_model->rotational_damping_n_m_s},
                                  {"rotational_stiffness_n_m", d.operator_model->rotational_stiffness_n_m}};
  }
  return json;
}

Json describe(const Scene& scene) {
  const Settings& s = scene.settings;
  Json users = Json::array();
  for (const UserSpec& user : scene.users) users.push_back(describe(user));
  Json haptic_engine = describe(s.haptic);
  haptic_engine["integration_substep_s"] =
      make_engine(s.haptic, {})->integration_substep_s(s.h_s);  // in which it integrates
  return {{"world_engine", describe(s.world)},
          {"haptic_engine", haptic_engine},
          {"settle_s", s.settle_s},
          {"settle_step_s", s.settle_step_s},
          {"paper",
           {{"device_force_in_world", s.paper.device_force_in_world},
            {"device_impulse_threshold_n_s", s.paper.device_impulse_threshold_n_s}}},
          {"delay",
           {{"up_s", s.delay.up_s},
            {"down_s", s.delay.down_s},
            {"from_device_s", s.delay.from_device_s},
            {"to_device_s", s.delay.to_device_s},
            {"jitter_s", s.delay.jitter_s},
            {"loss_ratio", s.delay.loss_ratio},
            {"seed", s.delay.seed}}},
          {"passivity", std::array{"automatic", "on", "off"}[static_cast<std::size_t>(s.passivity)]},
          {"disabled", disabled_names(s.disabled)},
          {"plan", to_json(plan_of(scene))},
          {"users", users}};
}

/// Bare wake-ups; late ones are later than the time that a haptic step leaves of its period.
Json describe(const Calibration& calibration, double spare_s) {
  return {{"period_s", calibration.period_s},
          {"loops", calibration.loops},
          {"wake_ups", calibration.lateness.count()},
          {"late", calibration.lateness.count_above(spare_s)},
          {"late_means_s", spare_s},
          {"woken_late_s", quantiles(calibration.lateness)},
          {"fifo", calibration.granted.fifo}};
}

/// The stages that take most of a loop's time.
void print_stages(const Json& stages) {
  constexpr double kLeastShare = 0.05;
  std::string text;
  for (const auto& [name, stage] : stages.items()) {
    const double share = stage.value("share", 0.0);
    if (share < kLeastShare) continue;
    text += fmt::format("{}{} {:.0f} % (p50 {:.3f}, p99 {:.3f} ms)", text.empty() ? "" : ", ",
                        name.substr(0, name.size() - 2), 100.0 * share, milliseconds(stage["p50"]),
                        milliseconds(stage["p99"]));
  }
  if (!text.empty()) fmt::print("    time of a step: {}\n", text);
}

}  // namespace

std::string to_text(const Calibration& calibration) {
  const Histogram& late = calibration.lateness;
  return fmt::format(
      "this machine wakes {} at {:.0f} Hz p99 {:.3f} ms late, at most {:.3f} ms, {} of {} times later than a period",
      calibration.loops == 1 ? "a bare loop" : fmt::format("{} bare loops", calibration.loops),
      1.0 / calibration.period_s, 1e3 * late.quantile_s(0.99), 1e3 * late.max_s(),
      late.count_above(calibration.period_s), late.count());
}

Json describe_run(const Scene& scene, const RunRecord& record) {
  const Settings& s = scene.settings;
  return {{"scene", scene.name},
          {"scene_file", scene.file},
          {"command_line", record.command_line},
          {"date", record.date},
          {"mode", s.mode == Mode::realtime ? "realtime" : "lockstep"},
          {"scheme", s.scheme},
          {"engine", s.world.name},
          {"haptic_engine", s.haptic.name},
          {"dds", record.dds},
          {"h_s", s.h_s},
          {"ratio", s.ratio},
          {"ratio_most", s.largest_ratio()},
          {"users", s.users},
          {"duration_s", s.duration_s},
          {"wall_s", record.wall_s},
          {"verdict", ""},
          {"gates", Json::array()},
          {"settings", describe(scene)},
          {"machine", machine()},
          {"placement", {{"world", record.placement.world}, {"others", record.placement.others}}},
          {"machine_load",
           {{"own_cores", record.load.own}, {"other_cores", record.load.other}, {"stolen_cores", record.load.stolen}}},
          {"version", version_text()}};
}

void add_parts(Json& summary, const Scene& scene, const RunRecord& record, const std::string& folder) {
  const Settings& s = scene.settings;
  const Json world = read_json(folder + "/world.json");
  std::vector<Json> haptics, devices;
  for (int u = 0; u < s.users; ++u) {
    haptics.push_back(read_json(fmt::format("{}/haptic_{}.json", folder, u)));
    haptics.back()["energy_excess_j"] = world["energy_excess_j"];
    devices.push_back(read_json(fmt::format("{}/device_{}.json", folder, u)));
  }
  summary["simulated_s"] = world["simulated_s"];
  summary["state_hash"] = world["state_hash"];
  summary["world"] = world["world"];
  summary["world"]["ending"] = world["ending"];
  summary["haptic"] = haptics;
  summary["device"] = devices;
  if (record.calibration) {
    const double step_s = summary["haptic"][0]["step_s"]["p50"].get<double>();
    summary["calibration"] = describe(*record.calibration, std::max(0.0, s.h_s - step_s));
  }
}

/// How many states of bodies were recorded, and a warning of dropped ones.
void print_body_history(const Json& written) {
  const double interval_s = written["interval_s"].get<double>();
  const auto dropped = written["rows_dropped"].get<std::uint64_t>();
  fmt::print("    {}: {} bodies {}, {} rows{}\n", written["file"].get<std::string>(), written["bodies"].get<int>(),
             interval_s > 0.0 ? fmt::format("every {:g} ms", 1e3 * interval_s) : "every cycle",
             written["rows"].get<std::uint64_t>(),
             dropped == 0
                 ? ""
                 : fmt::format("; warning: {} rows dropped, which could not be written in time; fewer --bodies, a "
                               "lower --bodies-rate, or lock-step, which waits for the file",
                               dropped));
}

std::string ratio_text(const Json& summary) {
  const int least = summary["ratio"].get<int>(), most = summary["ratio_most"].get<int>();
  if (least == most) return fmt::format("r = {}", least);
  return fmt::format("r = {} to {} (mean {:.1f})", least, most, summary["world"]["ratio"]["mean"].get<double>());
}

void print_summary(const Json& summary) {
  const Json& world = summary["world"];
  fmt::print("{} {}: {} bodies, {} user{}, scheme {}, {}, {}\n", summary["scene"].get<std::string>(),
             summary["mode"].get<std::string>(), world["bodies"].get<int>(), summary["users"].get<int>(),
             summary["users"] == 1 ? "" : "s", summary["scheme"].get<std::string>(), ratio_text(summary),
             summary["dds"].get<std::string>());
  fmt::print(
      "  world: {} cycles, step p50 {:.2f} ms, p99 {:.2f} ms, late {}, real-time factor >= {:.3f}, energy excess "
      "{:.2g} J\n",
      world["cycles"].get<std::uint64_t>(), milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]),
      world["late_cycles"].get<std::uint64_t>(), world["real_time_factor_min"].get<double>(),
      summary["haptic"][0]["energy_excess_j"].get<double>());
  if (const double slowed_s = world["slowed_s"].get<double>(); slowed_s > 0.0) {
    fmt::print(
        "    the clock was slowed for {:.2f} s, mean real-time factor {:.2f}; too slow even for the least factor for "
        "{:.2f} s; cure: fewer bodies, a larger --ratio, --preset fast or a faster engine\n",
        slowed_s, world["real_time_factor_mean"].get<double>(), world["stuck_s"].get<double>());
  }
  if (world.contains("body_history")) print_body_history(world["body_history"]);
  const bool realtime = summary["mode"] == "realtime";
  if (realtime) print_stages(world["stages"]);
  if (summary.contains("calibration")) {
    const Json& late = summary["calibration"]["woken_late_s"];
    fmt::print("  {}, p99 {:.3f} ms max {:.3f} ms; {}\n", calibration_text(summary), milliseconds(late["p99"]),
               milliseconds(late["max"]), load_text(summary));
  }
  for (const Json& haptic : summary["haptic"]) {
    const Json& device = summary["device"][haptic["user"].get<std::size_t>()];
    fmt::print(
        "  user {}: {:.0f} Hz, {} steps, {} missed ({} by the run, {} by the OS), lateness p99 {:.3f} ms, step p50 "
        "{:.3f} ms p99 {:.3f} ms\n",
        haptic["user"].get<int>(), 1.0 / summary["h_s"].get<double>(), haptic["steps"].get<std::uint64_t>(),
        haptic["missed_deadlines"].get<std::uint64_t>(), haptic["missed_by_run"].get<std::uint64_t>(),
        haptic["missed_by_os"].get<std::uint64_t>(), milliseconds(haptic["lateness_s"]["p99"]),
        milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]));
    if (realtime) {
      const Json& kernel = haptic["machine"];
      fmt::print("    woken late p99 {:.3f} ms max {:.3f} ms; pre-empted {} times, {:.1f} ms ready without a core\n",
                 milliseconds(haptic["woken_late_s"]["p99"]), milliseconds(haptic["woken_late_s"]["max"]),
                 kernel["involuntary_switches"].get<std::uint64_t>(), milliseconds(kernel["run_queue_delay_s"]));
    }
    fmt::print(
        "    force on the operator rms {:.2f} N, max {:.2f} N, largest step {:.2f} N; at the device's limit in {:.2g} "
        "% of steps\n",
        haptic["force_rms_n"].get<double>(), haptic["force_max_n"].get<double>(),
        haptic["force_step_max_n"].get<double>(), 100.0 * haptic["at_limit_ratio"].get<double>());
    fmt::print("    members mean {:.1f} max {:.0f}; border pairs mean {:.1f} max {:.0f}; contacts mean {:.1f}\n",
               haptic["members"]["mean"].get<double>(), haptic["members"]["max"].get<double>(),
               haptic["border_pairs"]["mean"].get<double>(), haptic["border_pairs"]["max"].get<double>(),
               haptic["contacts"]["mean"].get<double>());
    const auto missed = device["missed_deadlines"].get<std::uint64_t>();
    fmt::print(
        "    synchronisation p50 {:.3f} ms p99 {:.3f} ms; device round trip p50 {:.3f} ms p99 {:.3f} ms{}; {:.1f} kB a "
        "cycle\n",
        milliseconds(haptic["sync_s"]["p50"]), milliseconds(haptic["sync_s"]["p99"]),
        milliseconds(device["round_trip_s"]["p50"]), milliseconds(device["round_trip_s"]["p99"]),
        missed == 0 ? "" : fmt::format(", {} of its own deadlines missed", missed),
        1e-3 * haptic["bytes_per_cycle"].get<double>());
    if (realtime) print_stages(haptic["stages"]);
  }
}

}  // namespace subworld
