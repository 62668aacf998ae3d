#include "summary.hpp"

#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

namespace {

constexpr double kMissedRatio = 0.001;
constexpr double kLatenessP99_s = 0.25e-3;
constexpr double kAtLimitRatio = 0.01;
/// Least energy that counts, J: a device of 0.1 kg at 0.3 m/s, or a coupling of 1000 N/m that is stretched by 3 mm.
constexpr double kLeastEnergy_j = 0.005;
constexpr double kUnexplainedRatio = 0.01;  ///< of the energy that users put in
constexpr double kOscillationRatio = 0.05;  ///< of the device's force limit

constexpr double kFullCores = 0.8;   ///< share of the cores that our programs use: they hold each other up
constexpr double kQuietCores = 0.1;  ///< cores that others or the hypervisor take

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
  if (d.hand) {
    json["device"]["hand"] = {{"mass_kg", d.hand->mass_kg},
                              {"damping_n_s_m", d.hand->damping_n_s_m},
                              {"stiffness_n_m", d.hand->stiffness_n_m},
                              {"inertia_kg_m2", d.hand->inertia_kg_m2},
                              {"rotational_damping_n_m_s", d.hand->rotational_damping_n_m_s},
                              {"rotational_stiffness_n_m", d.hand->rotational_stiffness_n_m}};
  }
  return json;
}

Json describe(const Scene& scene) {
  const Settings& s = scene.settings;
  Json users = Json::array();
  for (const UserSpec& user : scene.users) users.push_back(describe(user));
  Json haptic_engine = describe(s.haptic);
  haptic_engine["part_s"] = make_engine(s.haptic, {})->part_s(s.h_s);  // in which it integrates
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
          {"keep", kept_names(s.keep)},
          {"users", users}};
}

/// How many bare wake-ups were later than what a step of the haptic loop leaves of its period.
Json describe(const Calibration& calibration, double spare_s) {
  return {{"period_s", calibration.period_s},
          {"loops", calibration.loops},
          {"wake_ups", calibration.lateness.count()},
          {"late", calibration.lateness.count_above(spare_s)},
          {"late_means_s", spare_s},
          {"woken_late_s", quantiles(calibration.lateness)},
          {"fifo", calibration.granted.fifo}};
}

double milliseconds(const Json& seconds) { return 1e3 * seconds.get<double>(); }

/// What kept the loops from their cores, in words.
std::string load_text(const Json& summary) {
  const Json& load = summary["machine_load"];
  return fmt::format("of {} cores our programs used {:.2f}, others {:.2f}, the hypervisor {:.2f}",
                     summary["machine"]["cores"].get<int>(), load["own_cores"].get<double>(),
                     load["other_cores"].get<double>(), load["stolen_cores"].get<double>());
}

/// Whether the loops of the run, more than anything else, kept this loop from its core for `lost_s`. Where nothing else
/// runs, who waits in the queue of a core with a real-time priority waits for another loop of ours, if there is one of
/// at least its priority: a rival.
bool kept_by_ours(const Json& loop, double lost_s, bool has_rivals, const Json& summary) {
  const Json& load = summary["machine_load"];
  const bool quiet = load["other_cores"].get<double>() + load["stolen_cores"].get<double>() < kQuietCores;
  const bool full = load["own_cores"] > kFullCores * summary["machine"]["cores"].get<double>();
  return quiet && (full || (has_rivals && loop["machine"]["run_queue_delay_s"].get<double>() > lost_s));
}

std::string calibration_text(const Json& summary) {
  if (!summary.contains("calibration")) return {};
  const Json& calibration = summary["calibration"];
  return fmt::format("calibration: {} in {} bare wake-ups", calibration["late"].get<std::uint64_t>(),
                     calibration["wake_ups"].get<std::uint64_t>());
}

/// Why a loop's own steps miss deadlines.
std::string why_we_missed(const Json& haptic, double h_s) {
  const double us = haptic["missed_by_us"].get<double>();
  if (haptic["missed_waiting"].get<double>() > 0.5 * us) {
    return "steps slept or waited for a lock, most likely in the middleware: look for a network that is slow, or try "
           "the "
           "other --dds";
  }
  return fmt::format(
      "steps take {:.2f} ms (p99 {:.2f}) of {:g} ms; fewer members: a lower budget_ratio or a smaller box_half_m; a "
      "faster preset or engine; "
      "or a "
      "longer h_s",
      milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]), 1e3 * h_s);
}

Gate machine_gate(const std::string& who, const Json& haptic, double periods, const Json& summary) {
  const double missed = haptic["missed_by_machine"].get<double>();
  Gate gate{who + "missed by the machine", missed / periods, kMissedRatio, true, "% of steps", 100.0};
  if (kept_by_ours(haptic, missed * summary["h_s"].get<double>(), summary["users"] > 1, summary)) {
    gate.why = fmt::format(
        "the programs of the run keep each other from the cores (this loop was ready for {:.0f} ms without one; {}); "
        "fewer members or users, more cores, a higher ratio, or a longer h_s",
        milliseconds(haptic["machine"]["run_queue_delay_s"]), load_text(summary));
  } else {
    gate.culprit = Culprit::machine;
    gate.why = fmt::format("the loop was woken late or pre-empted ({}; {}); run again when the machine is quiet",
                           calibration_text(summary), load_text(summary));
    if (!haptic["machine"]["fifo"].get<bool>()) gate.why += ", or with real-time rights";
  }
  return gate;
}

/// Energy that a hand was given and that neither it nor the bodies had.
Gate energy_gate(const std::string& who, const Json& haptic, const Json& device, const Json& world) {
  const Json& energy = device["hand_energy"];
  const double work_j = haptic["device_work_j"].get<double>();
  const double allowed_j =
      world["released_j"].get<double>() + std::max(kLeastEnergy_j, kUnexplainedRatio * std::abs(work_j));
  return {who + "created energy at the hand",
          energy["created_j"].get<double>(),
          allowed_j,
          true,
          "J",
          1.0,
          Culprit::unstable,
          fmt::format("the hand was given energy that nobody had put in (at least {:.3g} J net): a lower coupling "
                      "stiffness_n_m, less delay, a smaller --ratio, or --passivity on",
                      energy["least_j"].get<double>())};
}

/// Energy that the bodies gained and that neither hands nor their own fall had. What an engine gains and loses in
/// contacts is let pass.
Gate world_energy_gate(const Json& summary) {
  constexpr double kOfTheWork = 0.25, kOfTheFall = 0.05;
  const Json& world = summary["world"];
  double work_j = 0.0;
  for (const Json& haptic : summary["haptic"]) work_j += std::abs(haptic["device_work_j"].get<double>());
  const double allowed_j = world["contact_slack_j"].get<double>() + std::max(kLeastEnergy_j, kOfTheWork * work_j) +
                           kOfTheFall * world["released_j"].get<double>();
  const bool late_paper = summary.value("scheme", "") == "paper";
  return {"energy that the bodies gained",
          summary["haptic"][0]["energy_excess_j"].get<double>(),
          allowed_j,
          true,
          "J",
          1.0,
          Culprit::unstable,
          late_paper
              ? "nobody put it in: with late messages the scheme paper creates it; --scheme reduced, or less delay"
              : "nobody put it in: a smaller --ratio, --preset quality, or another --engine"};
}

Gate oscillation_gate(const std::string& who, const Json& device, double force_limit_n) {
  return {
      who + "oscillation of the force",
      device["oscillation_n"].get<double>(),
      kOscillationRatio * force_limit_n,
      true,
      "N rms",
      1.0,
      Culprit::unstable,
      "the force swings faster than a hand moves: a lower coupling stiffness_n_m or damping_n_s_m, a smaller --ratio "
      "or h_s, or the scheme reduced"};
}

/// Samples of programs that do not belong to the run.
void add_stranger_gates(std::vector<Gate>& all, const std::string& who, const Json& refused) {
  struct Sender {
    const char* topic;
    const char* program;
  };
  constexpr std::array kSenders{Sender{"scene", "world_sim"}, Sender{"world_frame", "world_sim"},
                                Sender{"haptic_report", "haptic_sim"}, Sender{"device_state", "device_sim"},
                                Sender{"device_command", "haptic_sim"}};
  for (const Sender& sender : kSenders) {
    if (!refused.contains(sender.topic)) continue;
    all.push_back({fmt::format("{}{} from a stranger", who, sender.topic), refused[sender.topic].get<double>(), 0.0,
                   true, "", 1.0, Culprit::stranger,
                   fmt::format("another program sent them as {}, and they were refused; end it, or give it another "
                               "--domain",
                               sender.program)});
  }
}

const char* name_of(Culprit culprit) {
  switch (culprit) {
    case Culprit::us:
      return "us";
    case Culprit::machine:
      return "machine";
    case Culprit::unstable:
      return "unstable";
    case Culprit::stranger:
      return "stranger";
    case Culprit::scene:
      break;
  }
  return "scene";
}

/// Where a loop's time goes: the stages that take most of it.
void print_stages(const Json& stages) {
  constexpr double kWorthSaying = 0.05;
  std::string text;
  for (const auto& [name, stage] : stages.items()) {
    const double share = stage.value("share", 0.0);
    if (share < kWorthSaying) continue;
    text += fmt::format("{}{} {:.0f} % (p50 {:.3f}, p99 {:.3f} ms)", text.empty() ? "" : ", ",
                        name.substr(0, name.size() - 2), 100.0 * share, milliseconds(stage["p50"]),
                        milliseconds(stage["p99"]));
  }
  if (!text.empty()) fmt::print("    time of a step: {}\n", text);
}

}  // namespace

std::string Gate::line() const {
  const std::string held = fmt::format("{} {:.4g}{}{} {} {:.4g}{}{}", name, scale * value, *unit ? " " : "", unit,
                                       at_most ? "<=" : ">=", scale * bar, *unit ? " " : "", unit);
  if (ok()) return held + ": ok";
  return fmt::format("{}: {}{}{}", held, spoils_verdict() ? "MISSED" : "warning", why.empty() ? "" : ": ", why);
}

Json to_json(const Gate& gate) {
  Json json{{"name", gate.name},
            {"value", gate.value},
            {"bound", gate.bar},
            {"at_most", gate.at_most},
            {"unit", gate.scale == 100.0 ? "ratio"
                     : gate.scale == 1e3 ? "s"
                                         : "1"},
            {"ok", gate.ok()},
            {"warning", !gate.ok() && !gate.spoils_verdict()}};
  if (!gate.ok()) {
    json["missed_by"] = name_of(gate.culprit);
    json["why"] = gate.why;
  }
  return json;
}

std::string to_text(const Calibration& calibration) {
  const Histogram& late = calibration.lateness;
  return fmt::format(
      "the machine wakes {} at {:.0f} Hz p99 {:.3f} ms late, at most {:.3f} ms, {} of {} times later than a period",
      calibration.loops == 1 ? "a bare loop" : fmt::format("{} bare loops", calibration.loops),
      1.0 / calibration.period_s, 1e3 * late.quantile_s(0.99), 1e3 * late.max_s(),
      late.count_above(calibration.period_s), late.count());
}

Json describe_run(const Scene& scene, const RunRecord& record) {
  const Settings& s = scene.settings;
  const double wall_s = std::max(1e-3, record.wall_s);
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
           {{"own_cores", record.own_cpu_s / wall_s},
            {"other_cores", record.other_cpu_s / wall_s},
            {"stolen_cores", record.stolen_s / wall_s}}},
          {"version", "0.1.0"}};
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

std::vector<Gate> gates(const Json& summary) {
  std::vector<Gate> all;  // causes before what follows from them: a verdict gives the first reason
  const bool realtime = summary["mode"] == "realtime";
  const double h_s = summary["h_s"].get<double>();
  add_stranger_gates(all, "", summary["world"]["refused"]);
  all.push_back(world_energy_gate(summary));
  for (const Json& haptic : summary["haptic"]) {
    const std::string who = fmt::format("user {}: ", haptic["user"].get<int>());
    const Json& device = summary["device"][haptic["user"].get<std::size_t>()];
    const Json& spec = summary["settings"]["users"][haptic["user"].get<std::size_t>()]["device"];
    add_stranger_gates(all, who, haptic["refused"]);
    add_stranger_gates(all, who, device["refused"]);
    all.push_back(energy_gate(who, haptic, device, summary["world"]));
    all.push_back(oscillation_gate(who, device, spec["force_limit_n"].get<double>()));
    if (realtime) {
      const double periods = std::max(1.0, haptic["steps"].get<double>() + haptic["skipped_steps"].get<double>());
      const std::string why_us = why_we_missed(haptic, h_s);
      all.push_back({who + "missed by us", haptic["missed_by_us"].get<double>() / periods, kMissedRatio, true,
                     "% of steps", 100.0, Culprit::us, why_us});
      const Gate by_machine = machine_gate(who, haptic, periods, summary);
      all.push_back(by_machine);
      const bool woken_late = haptic["woken_late_s"]["p99"].get<double>() > kLatenessP99_s;
      all.push_back({who + "lateness p99", haptic["lateness_s"]["p99"].get<double>(), kLatenessP99_s, true, "ms", 1e3,
                     woken_late ? by_machine.culprit : Culprit::us, woken_late ? by_machine.why : why_us});
    }
    all.push_back({who + "lost frames", haptic["lost_frames"].get<double>(), 0.0, true, "", 1.0, Culprit::us,
                   "frames of the world were lost on the way: the network, or a sub-world that was halted"});
    all.push_back(
        {who + "at the device's limit", haptic["at_limit_ratio"].get<double>(), kAtLimitRatio, true, "% of steps",
         100.0, Culprit::scene,
         "the hand feels the limit, not the scene: move the device less far into bodies, lower the coupling's "
         "stiffness, or raise the device's force_limit_n"});
  }
  if (realtime) {
    const Json& world = summary["world"];
    const double by_us = world["late_by_us"].get<double>(), by_machine = world["late_by_machine"].get<double>();
    const bool has_own_core = !summary["placement"]["world"].empty();
    const double cycle_s = h_s * world["ratio"]["mean"].get<double>();
    const bool ours = by_us > by_machine || kept_by_ours(world, by_machine * cycle_s, !has_own_core, summary);
    all.push_back(
        {"world clock factor", world["clock_factor_min"].get<double>(), 1.0, false, "", 1.0,
         ours ? Culprit::us : Culprit::machine,
         ours ? fmt::format(
                    "the world's step takes {:.2f} ms (p99 {:.2f}) of cycles of {:.3g} ms; a higher ratio, fewer "
                    "bodies, or a faster preset or engine",
                    milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]), 1e3 * cycle_s)
              : fmt::format("the world was woken late or pre-empted ({}); run again when the machine is quiet",
                            load_text(summary))});
  }
  return all;
}

std::string verdict_of(const std::vector<Gate>& gates, const Json& summary) {
  std::vector<std::string> unstable, ours, machines;
  for (const Gate& gate : gates) {
    if (!gate.spoils_verdict()) continue;
    std::vector<std::string>& words = gate.culprit == Culprit::unstable  ? unstable
                                      : gate.culprit == Culprit::machine ? machines
                                                                         : ours;
    const std::string text = fmt::format("{} {:.4g}{}{}: {}", gate.name, gate.scale * gate.value, *gate.unit ? " " : "",
                                         gate.unit, gate.why);
    words.push_back(text);
  }
  // One reason is enough; all of them are in the gates.
  if (!unstable.empty()) return "unstable: " + unstable.front();
  if (!ours.empty()) return "quality gate missed: " + ours.front();
  if (!machines.empty()) return "quality gate missed by the machine: " + machines.front();
  std::uint64_t late = 0, periods = 0;
  for (const Json& haptic : summary["haptic"]) {
    late += haptic["missed_by_machine"].get<std::uint64_t>();
    periods += haptic["steps"].get<std::uint64_t>() + haptic["skipped_steps"].get<std::uint64_t>();
  }
  if (late == 0) return "ok";
  return fmt::format("ok; the machine itself was late {} time{} in {} steps ({})", late, late == 1 ? "" : "s", periods,
                     calibration_text(summary));
}

/// How many states of bodies were written down, and a warning of those that were not.
void print_body_history(const Json& written) {
  const double interval_s = written["interval_s"].get<double>();
  const auto dropped = written["rows_dropped"].get<std::uint64_t>();
  fmt::print("    {}: {} bodies {}, {} rows{}\n", written["file"].get<std::string>(), written["bodies"].get<int>(),
             interval_s > 0.0 ? fmt::format("every {:g} ms", 1e3 * interval_s) : "every cycle",
             written["rows"].get<std::uint64_t>(),
             dropped == 0
                 ? ""
                 : fmt::format("; warning: {} rows dropped, which could not be written in time; fewer --bodies, "
                               "a lower --bodies-rate, or lock-step, which waits for the file",
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
      "  world: {} cycles, step p50 {:.2f} ms, p99 {:.2f} ms, late {}, clock factor >= {:.3f}, energy excess {:.2g} "
      "J\n",
      world["cycles"].get<std::uint64_t>(), milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]),
      world["late_cycles"].get<std::uint64_t>(), world["clock_factor_min"].get<double>(),
      summary["haptic"][0]["energy_excess_j"].get<double>());
  if (const double slowed_s = world["slowed_s"].get<double>(); slowed_s > 0.0) {
    fmt::print(
        "    its clock was slowed for {:.2f} s, mean factor {:.2f}; stuck beyond its slowest clock for {:.2f} s; cure: "
        "fewer bodies, a larger --ratio, --preset fast or a faster engine\n",
        slowed_s, world["clock_factor_mean"].get<double>(), world["stuck_s"].get<double>());
  }
  if (world.contains("body_history")) print_body_history(world["body_history"]);
  const bool realtime = summary["mode"] == "realtime";
  if (realtime) print_stages(world["stages"]);
  if (summary.contains("calibration")) {
    const Json& late = summary["calibration"]["woken_late_s"];
    fmt::print("  machine: {}, p99 {:.3f} ms max {:.3f} ms; {}\n", calibration_text(summary), milliseconds(late["p99"]),
               milliseconds(late["max"]), load_text(summary));
  }
  for (const Json& haptic : summary["haptic"]) {
    const Json& device = summary["device"][haptic["user"].get<std::size_t>()];
    fmt::print(
        "  user {}: {:.0f} Hz, {} steps, {} missed ({} by us, {} by the machine), lateness p99 {:.3f} ms, step p50 "
        "{:.3f} "
        "ms p99 {:.3f} ms\n",
        haptic["user"].get<int>(), 1.0 / summary["h_s"].get<double>(), haptic["steps"].get<std::uint64_t>(),
        haptic["missed_deadlines"].get<std::uint64_t>(), haptic["missed_by_us"].get<std::uint64_t>(),
        haptic["missed_by_machine"].get<std::uint64_t>(), milliseconds(haptic["lateness_s"]["p99"]),
        milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]));
    if (realtime) {
      const Json& kernel = haptic["machine"];
      fmt::print("    woken late p99 {:.3f} ms max {:.3f} ms; pre-empted {} times, {:.1f} ms ready without a core\n",
                 milliseconds(haptic["woken_late_s"]["p99"]), milliseconds(haptic["woken_late_s"]["max"]),
                 kernel["involuntary_switches"].get<std::uint64_t>(), milliseconds(kernel["run_queue_delay_s"]));
    }
    fmt::print(
        "    force on the hand rms {:.2f} N, max {:.2f} N, largest step {:.2f} N; at the device's limit in {:.2g} % of "
        "steps\n",
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
