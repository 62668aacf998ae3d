#include "summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kMissedRatio = 0.001;
constexpr double kLatenessP99_s = 0.25e-3;
constexpr double kAtLimitRatio = 0.01;

Json describe(const EngineSettings& engine) {
  Json json{{"name", engine.name}, {"preset", engine.preset}};
  if (engine.iterations) json["iterations"] = *engine.iterations;
  if (engine.substeps) json["substeps"] = *engine.substeps;
  return json;
}

double milliseconds(const Json& seconds) { return 1e3 * seconds.get<double>(); }

}  // namespace

std::string Gate::line() const {
  return fmt::format("{} {:.4g}{}{} {} {:.4g}{}{}: {}", name, scale * value, *unit ? " " : "", unit,
                     at_most ? "<=" : ">=", scale * bar, *unit ? " " : "", unit,
                     ok() ? "ok" : (warning.empty() ? "MISSED" : "warning: " + warning));
}

Json summarise(const Scene& scene, const std::string& dds, const std::string& folder) {
  const Settings& s = scene.settings;
  const Json world = read_json(folder + "/world.json");
  Json summary{{"scene", scene.name},
               {"scene_file", scene.file},
               {"mode", s.mode == Mode::realtime ? "realtime" : "lockstep"},
               {"scheme", s.scheme},
               {"engine", s.world.name},
               {"haptic_engine", s.haptic.name},
               {"dds", dds},
               {"h_s", s.h_s},
               {"ratio", s.ratio},
               {"users", s.users},
               {"duration_s", s.duration_s},
               {"simulated_s", world["simulated_s"]},
               {"state_hash", world["state_hash"]},
               {"verdict", "ok"},
               {"settings",
                {{"world_engine", describe(s.world)},
                 {"haptic_engine", describe(s.haptic)},
                 {"settle_s", s.settle_s},
                 {"settle_step_s", s.settle_step_s},
                 {"device_force_in_world", s.paper.device_force_in_world},
                 {"device_impulse_threshold_n_s", s.paper.device_impulse_threshold_n_s}}},
               {"machine", machine()},
               {"version", "0.1.0"},
               {"world", world["world"]},
               {"haptic", Json::array()},
               {"device", Json::array()}};
  for (int u = 0; u < s.users; ++u) {
    Json haptic = read_json(fmt::format("{}/haptic_{}.json", folder, u));
    haptic["energy_excess_j"] = world["energy_excess_j"];
    summary["haptic"].push_back(std::move(haptic));
    summary["device"].push_back(read_json(fmt::format("{}/device_{}.json", folder, u)));
  }
  return summary;
}

std::vector<Gate> gates(const Json& summary) {
  std::vector<Gate> all;
  const bool realtime = summary["mode"] == "realtime";
  for (const Json& haptic : summary["haptic"]) {
    const std::string who = fmt::format("user {}: ", haptic["user"].get<int>());
    const double periods = std::max(1.0, haptic["steps"].get<double>() + haptic["skipped_steps"].get<double>());
    all.push_back({who + "lost frames", haptic["lost_frames"].get<double>(), 0.0});
    all.push_back(
        {who + "at the device's limit", haptic["at_limit_ratio"].get<double>(), kAtLimitRatio, true, "% of steps",
         100.0,
         "the hand feels the limit, not the scene: move the device less far into bodies, lower the coupling's "
         "stiffness, or raise the device's force_limit_n"});
    if (!realtime) continue;
    all.push_back({who + "missed deadlines", haptic["missed_deadlines"].get<double>() / periods, kMissedRatio, true,
                   "% of steps", 100.0});
    all.push_back({who + "lateness p99", haptic["lateness_s"]["p99"].get<double>(), kLatenessP99_s, true, "ms", 1e3});
  }
  if (realtime) all.push_back({"world clock factor", summary["world"]["clock_factor_min"].get<double>(), 1.0, false});
  return all;
}

void print_summary(const Json& summary) {
  const Json& world = summary["world"];
  fmt::print("{} {}: {} bodies, {} user{}, scheme {}, r = {}, {}\n", summary["scene"].get<std::string>(),
             summary["mode"].get<std::string>(), world["bodies"].get<int>(), summary["users"].get<int>(),
             summary["users"] == 1 ? "" : "s", summary["scheme"].get<std::string>(), summary["ratio"].get<int>(),
             summary["dds"].get<std::string>());
  fmt::print(
      "  world: {} cycles, step p50 {:.2f} ms, p99 {:.2f} ms, late {}, clock factor >= {:.3f}, energy excess {:.2g} "
      "J\n",
      world["cycles"].get<std::uint64_t>(), milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]),
      world["late_cycles"].get<std::uint64_t>(), world["clock_factor_min"].get<double>(),
      summary["haptic"][0]["energy_excess_j"].get<double>());
  for (const Json& haptic : summary["haptic"]) {
    const Json& device = summary["device"][haptic["user"].get<std::size_t>()];
    fmt::print("  user {}: {:.0f} Hz, {} steps, {} missed, lateness p99 {:.3f} ms, step p50 {:.3f} ms p99 {:.3f} ms\n",
               haptic["user"].get<int>(), 1.0 / summary["h_s"].get<double>(), haptic["steps"].get<std::uint64_t>(),
               haptic["missed_deadlines"].get<std::uint64_t>(), milliseconds(haptic["lateness_s"]["p99"]),
               milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]));
    fmt::print(
        "    force on the hand rms {:.2f} N, max {:.2f} N, largest step {:.2f} N; at the device's limit in {:.2g} % of "
        "steps\n",
        haptic["force_rms_n"].get<double>(), haptic["force_max_n"].get<double>(),
        haptic["force_step_max_n"].get<double>(), 100.0 * haptic["at_limit_ratio"].get<double>());
    fmt::print("    members mean {:.1f} max {:.0f}; border pairs mean {:.1f} max {:.0f}; contacts mean {:.1f}\n",
               haptic["members"]["mean"].get<double>(), haptic["members"]["max"].get<double>(),
               haptic["border_pairs"]["mean"].get<double>(), haptic["border_pairs"]["max"].get<double>(),
               haptic["contacts"]["mean"].get<double>());
    fmt::print(
        "    synchronisation p50 {:.3f} ms p99 {:.3f} ms; device round trip p50 {:.3f} ms p99 {:.3f} ms; {:.1f} kB a "
        "cycle\n",
        milliseconds(haptic["sync_s"]["p50"]), milliseconds(haptic["sync_s"]["p99"]),
        milliseconds(device["round_trip_s"]["p50"]), milliseconds(device["round_trip_s"]["p99"]),
        1e-3 * haptic["bytes_per_cycle"].get<double>());
  }
}

}  // namespace subworld
