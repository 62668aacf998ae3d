#include "judge/summary.hpp"

#include "coupling/plan.hpp"
#include "io/results/json.hpp"
#include "io/version.hpp"
#include "judge/gates.hpp"
#include "model/settings/settings.hpp"
#include "physics/plugin.hpp"
#include "watch/progress.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

namespace subworld {

SUBWORLD_JSON(BareLoops, period_s, loops, wake_ups, late, late_means_s, woken_late_s, fifo)

namespace {

/// Settings that have another place in `settings` of the summary than in a scene.
constexpr std::pair<std::string_view, std::string_view> kPlaces[]{{"settle.duration_s", "settle_s"},
                                                                  {"settle.step_s", "settle_step_s"},
                                                                  {"disable", "disabled"},
                                                                  {"world.engine", "world_engine.name"},
                                                                  {"haptic.engine", "haptic_engine.name"},
                                                                  {"world.", "world_engine."},
                                                                  {"haptic.", "haptic_engine."},
                                                                  {"users.selection", "selection.by"},
                                                                  {"users.box_half_m", "selection.box_half_m"},
                                                                  {"users.contact_depth", "selection.contact_depth"},
                                                                  {"users.budget_ratio", "selection.budget_ratio"},
                                                                  {"users.", ""}};

/// As in "selection.by". Without the unit of an angle: "coupling.rotational_stiffness_n_m".
std::string place_of(std::string key) {
  for (const auto& [begin, instead] : kPlaces) {
    if (!key.starts_with(begin)) continue;
    key = std::string(instead) + key.substr(begin.size());
    break;
  }
  constexpr std::string_view kAngle = "_rad";
  return key.ends_with(kAngle) ? key.substr(0, key.size() - kAngle.size()) : key;
}

void put_settings(Json& json, bool of_user, Settings& settings, UserSpec& user) {
  for (const Setting& one : settings_table()) {
    const Json value = one.of_user() == of_user ? json_of(one, settings, user) : Json();
    if (value.is_null()) continue;
    std::string place = place_of(one.key);
    std::ranges::replace(place, '.', '/');
    json[Json::json_pointer("/" + place)] = value;
  }
}

/// What an engine says of itself.
void put_engine(Json& json, const EngineSettings& engine) {
  const EnginePlugin& plugin = engine_plugin(engine.name);
  json["version"] = plugin.version;
  json["gravity_m_s2"] = {engine.gravity.x(), engine.gravity.y(), engine.gravity.z()};
  const auto preset = std::ranges::find(plugin.presets, engine.preset, &EnginePreset::name);
  if (preset != plugin.presets.end()) json["preset_means"] = preset->what;
}

Json describe(const Scene& scene) {
  Settings s = scene.settings;
  UserSpec none;
  Json json;
  put_settings(json, false, s, none);
  put_engine(json["world_engine"], s.world);
  put_engine(json["haptic_engine"], s.haptic);
  json["haptic_engine"]["integration_substep_s"] =
      make_engine(s.haptic, {})->integration_substep_s(s.h_s);  // in which it integrates
  json["disabled"] = disabled_names(s.disabled);
  json["plan"] = to_json(plan_of(scene));
  json["users"] = Json::array();
  for (UserSpec user : scene.users) {
    Json& of = json["users"].emplace_back(Json{{"name", user.name}});
    put_settings(of, true, s, user);
    const DeviceSpec& d = user.device;
    of["device"]["force_rate_limit_n_s"] = d.force_rate_limit_n_s.value_or(d.force_limit_n / DeviceSpec::kFullScale_s);
    of["device"]["power_limit_w"] = d.power_limit_w.value_or(d.force_limit_n * DeviceSpec::kFastestPush_m_s);
    of["device"]["path_segments"] = d.path.size();
  }
  return json;
}

/// The stages that take most of a loop's time.
void print_stages(const StageTimes& stages) {
  constexpr double kLeastShare = 0.05;
  std::string text;
  for (const StageTime& stage : stages.all) {
    if (stage.share.value_or(0.0) < kLeastShare) continue;
    text += fmt::format("{}{} {:.0f} % (p50 {:.3f}, p99 {:.3f} ms)", text.empty() ? "" : ", ", stage.name,
                        100.0 * *stage.share, 1e3 * stage.p50, 1e3 * stage.p99);
  }
  if (!text.empty()) fmt::print("    time of a step: {}\n", text);
}

void print_recording(const RecordingResult& recording) {
  fmt::print("  recording: {}: {} of {} messages, {:.1f} MB; the recorder used {:.2f} s of CPU{}{}\n", recording.file,
             grouped(recording.recorded), grouped(recording.sent), 1e-6 * static_cast<double>(recording.bytes),
             recording.cpu_s, recording.fault.empty() ? "" : "; ", recording.fault);
}

/// How many states of bodies were recorded, and a warning of dropped ones.
void print_body_history(const BodyHistoryResult& written) {
  fmt::print("    {}: {} {}, {} rows{}\n", written.file, bodies_text(written.bodies),
             written.interval_s > 0.0 ? fmt::format("every {:g} ms", 1e3 * written.interval_s) : "every cycle",
             written.rows,
             written.rows_dropped == 0
                 ? ""
                 : fmt::format("; warning: {} rows dropped, which could not be written in time; fewer --bodies, a "
                               "lower --bodies-rate, or lock-step, which waits for the file",
                               written.rows_dropped));
}

std::string ratio_text(const RunResults& run) {
  const auto [least, most] = run.scene.settings.ratio_bounds();
  if (least == most) return fmt::format("r = {}", least);
  return fmt::format("r = {} to {} (mean {:.1f})", least, most, run.world.ratio.mean());
}

void print_world(const RunResults& run) {
  const WorldResult& world = run.world;
  fmt::print(
      "  world: {} cycles, step p50 {:.2f} ms, p99 {:.2f} ms, late {}, real-time factor >= {:.3f}, energy excess "
      "{:.2g} J\n",
      world.cycles, 1e3 * world.step_s.p50, 1e3 * world.step_s.p99, world.late_cycles, world.real_time_factor_min,
      run.energy_excess_j);
  if (world.slowed_s > 0.0) {
    fmt::print(
        "    the clock was slowed for {:.2f} s, mean real-time factor {:.2f}; too slow even for the least factor for "
        "{:.2f} s; cure: fewer bodies, a larger --ratio, --set world.preset=fast or a faster engine\n",
        world.slowed_s, world.real_time_factor_mean, world.stuck_s);
  }
  if (world.body_history) print_body_history(*world.body_history);
  if (run.realtime()) print_stages(world.stages);
}

void print_user(const RunResults& run, const HapticResult& haptic, const DeviceResult& device) {
  fmt::print(
      "  user {}: {:.0f} Hz, {} steps, {} missed ({} by the run, {} by the OS), lateness p99 {:.3f} ms, step p50 "
      "{:.3f} ms p99 {:.3f} ms\n",
      haptic.user, 1.0 / run.scene.settings.h_s, haptic.steps, haptic.missed_deadlines, haptic.missed_by_run,
      haptic.missed_by_os, 1e3 * haptic.lateness_s.p99, 1e3 * haptic.step_s.p50, 1e3 * haptic.step_s.p99);
  if (run.realtime()) {
    fmt::print("    woken late p99 {:.3f} ms max {:.3f} ms; pre-empted {} times, {:.1f} ms ready without a core\n",
               1e3 * haptic.woken_late_s.p99, 1e3 * haptic.woken_late_s.max, haptic.machine.involuntary_switches,
               1e3 * haptic.machine.run_queue_delay_s);
  }
  fmt::print(
      "    force on the operator rms {:.2f} N, max {:.2f} N, largest step {:.2f} N; at the device's limit in {:.2g} % "
      "of steps\n",
      haptic.force_rms_n, haptic.force_max_n, haptic.force_step_max_n, 100.0 * haptic.at_limit_ratio);
  fmt::print("    members mean {:.1f} max {:.0f}; border pairs mean {:.1f} max {:.0f}; contacts mean {:.1f}\n",
             haptic.members.mean(), haptic.members.max, haptic.border_pairs.mean(), haptic.border_pairs.max,
             haptic.contacts.mean());
  fmt::print(
      "    synchronisation p50 {:.3f} ms p99 {:.3f} ms; device round trip p50 {:.3f} ms p99 {:.3f} ms{}; {:.1f} kB a "
      "cycle\n",
      1e3 * haptic.sync_s.p50, 1e3 * haptic.sync_s.p99, 1e3 * device.round_trip_s.p50, 1e3 * device.round_trip_s.p99,
      device.missed_deadlines == 0 ? "" : fmt::format(", {} of its own deadlines missed", device.missed_deadlines),
      1e-3 * haptic.bytes_per_cycle);
  if (run.realtime()) print_stages(haptic.stages);
}

}  // namespace

std::string part_file(const std::string& folder, std::string_view program, int user) {
  const std::string_view name = program.substr(0, program.find('_'));
  return user < 0 ? fmt::format("{}/{}.json", folder, name) : fmt::format("{}/{}_{}.json", folder, name, user);
}

std::string program_of_part(const std::string& part_file) {
  const std::string name = std::filesystem::path(part_file).stem();
  const std::size_t end = name.find('_');
  return name.substr(0, end) + "_sim" + (end == std::string::npos ? "" : " " + name.substr(end + 1));
}

namespace {

/// The run began without this user, whose programs have left no results here.
bool took_no_part(const std::string& folder, int user, const WorldResult& world) {
  const auto is_user = [&](const Absence& one) {
    return one.user == static_cast<std::size_t>(user) && one.from_s == 0.0 && one.by_order;
  };
  return std::ranges::any_of(world.absences, is_user) &&
         !std::filesystem::exists(part_file(folder, "haptic_sim", user)) &&
         !std::filesystem::exists(part_file(folder, "device_sim", user));
}

}  // namespace

void read_parts(RunResults& run, const std::string& folder, const std::optional<Calibration>& calibration) {
  const auto world = read_json(part_file(folder, "world_sim", -1)).get<WorldPart>();
  std::vector<HapticResult> haptic;
  for (int u = 0; u < run.scene.settings.users; ++u) {
    if (took_no_part(folder, u, world.world)) continue;
    haptic.push_back(read_json(part_file(folder, "haptic_sim", u)));
    run.device.push_back(read_json(part_file(folder, "device_sim", u)));
  }
  static_cast<WorldPart&>(run) = world;
  run.haptic = std::move(haptic);
  if (!calibration) return;
  const double spare_s = std::max(0.0, run.scene.settings.h_s - run.haptic[0].step_s.p50);
  run.calibration = {calibration->period_s,
                     calibration->loops,
                     calibration->lateness.count(),
                     calibration->lateness.count_above(spare_s),
                     spare_s,
                     quantiles(calibration->lateness),
                     calibration->granted.fifo};
}

void to_json(Json& json, const RunResults& run) {
  const Settings& s = run.scene.settings;
  json = {{"scene", run.scene.name},
          {"scene_file", run.scene.file},
          {"command_line", run.command_line},
          {"date", run.date},
          {"mode", run.realtime() ? "realtime" : "lockstep"},
          {"scheme", s.scheme},
          {"engine", s.world.name},
          {"haptic_engine", s.haptic.name},
          {"dds", run.dds},
          {"h_s", s.h_s},
          {"ratio", s.ratio},
          {"ratio_most", s.largest_ratio()},
          {"users", s.users},
          {"duration_s", s.duration_s},
          {"wall_s", run.wall_s},
          {"verdict", run.verdict},
          {"gates", run.gates},
          {"settings", describe(run.scene)},
          {"machine", machine()},
          {"placement", {{"world", run.placement.world}, {"others", run.placement.others}}},
          {"machine_load", nullptr},
          {"version", version_text()}};
  if (run.load) {
    json["machine_load"] = {
        {"own_cores", run.load->own}, {"other_cores", run.load->other}, {"stolen_cores", run.load->stolen}};
    if (run.quota) json["machine_load"]["granted_cores"] = run.quota->cores;
  }
  if (!run.session.empty()) json["session"] = run.session;
  put(json, "link", run.link);
  for (const HostClock& host : run.hosts) {
    json["hosts"].push_back({{"host", host.host}, {"clock_offset_s", nullptr}, {"clock_uncertainty_s", nullptr}});
    put(json["hosts"].back(), "clock_offset_s", host.offset_s);
    put(json["hosts"].back(), "clock_uncertainty_s", host.uncertainty_s);
  }
  for (const Restarted& one : run.restarts)
    json["restarts"].push_back({{"program", one.program}, {"after_s", one.after_s}, {"reason", one.reason}});
  put(json, "recording", run.recording);
  if (run.partial) json["partial"] = true;
  if (run.salvaged.is_object()) json.update(run.salvaged);
  if (run.haptic.empty()) return;
  json["simulated_s"] = run.simulated_s;
  json["state_hash"] = run.state_hash;
  json["world"] = run.world;
  json["world"]["ending"] = run.ending;
  json["presence"] = run.world.presence;
  json["haptic"] = run.haptic;
  for (Json& haptic : json["haptic"]) haptic["energy_excess_j"] = run.energy_excess_j;
  json["device"] = run.device;
  put(json, "calibration", run.calibration);
  put(json, "display", run.display);
}

void print_summary(const RunResults& run) {
  const Settings& s = run.scene.settings;
  fmt::print("{} {}: {}, {} user{}, scheme {}, {}, {}\n", run.scene.name, run.realtime() ? "realtime" : "lockstep",
             bodies_text(run.world.bodies), s.users, s.users == 1 ? "" : "s", s.scheme, ratio_text(run), run.dds);
  print_world(run);
  if (run.calibration) {
    fmt::print("  {}, p99 {:.3f} ms max {:.3f} ms; {}\n", calibration_text(run),
               1e3 * run.calibration->woken_late_s.p99, 1e3 * run.calibration->woken_late_s.max, load_text(run));
  }
  if (run.recording) print_recording(*run.recording);
  for (std::size_t u = 0; u < run.haptic.size(); ++u) print_user(run, run.haptic[u], run.device[u]);
}

}  // namespace subworld
