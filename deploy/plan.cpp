#include "coupling/passivity.hpp"
#include "coupling/scheme.hpp"
#include "coupling/stiffness.hpp"
#include "launch.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace subworld {

namespace {

const char* to_text(Fidelity fidelity) {
  switch (fidelity) {
    case Fidelity::absent:
      return "none";
    case Fidelity::estimated:
      return "estimated";
    case Fidelity::exact:
      break;
  }
  return "exact";
}

/// A line of what the engine is and one of what matters of it here. Throws `Error` (usage) where the settings name no
/// engine or preset.
std::string describe_engine(const char* where, const EngineSettings& settings) {
  const EnginePlugin& plugin = engine_plugin(settings.name);
  const std::size_t preset = find_preset(plugin, settings.preset);
  std::string asked;
  if (settings.iterations) asked += fmt::format("; here {} iterations", *settings.iterations);
  if (settings.substeps) asked += fmt::format("; here {} sub-steps", *settings.substeps);
  const Capabilities can = make_engine(settings, {})->capabilities();
  return fmt::format(
      "  {}: engine {} ({}; licence {}), preset {}: {}{}\n"
      "    normal impulses {}, friction impulses {}, gyroscopic torque {}, checkpoint {}, {}; unit of length {:g} m\n",
      where, plugin.name, plugin.version, plugin.licence, settings.preset, plugin.presets[preset].what, asked,
      to_text(can.normal_impulse), to_text(can.tangential_impulse), to_text(can.gyroscopic), to_text(can.checkpoint),
      can.deterministic ? "deterministic" : "not deterministic", settings.length_unit_m);
}

void warn_of_small_boxes(const char* where, const EngineSettings& settings, const Scene& scene) {
  const double smallest_m = engine_plugin(settings.name).smallest_box * settings.length_unit_m;
  const auto small = std::ranges::find_if(scene.bodies, [&](const Body& body) {
    return body.shape.kind == ShapeKind::box && 2.0 * body.shape.half_extents.minCoeff() < smallest_m;
  });
  if (small == scene.bodies.end()) return;
  fmt::print(stderr,
             "subworld: {0}: {1} does not hold boxes with a side below {2:g} m in a unit of length of {3:g} m, as {4} "
             "has; it may fall through the floor. Set {0}.length_unit_m: {5:g}, or choose another engine\n",
             where, settings.name, smallest_m, settings.length_unit_m, small->name, 0.1 * settings.length_unit_m);
}

/// A wall is the hardest that a coupling can meet.
void warn_of_stiffness(const UserSpec& user, const Settings& settings) {
  if (user.device.kind != DeviceKind::impedance) return;
  const double most_n_m = largest_stiffness(user, settings);
  const double wanted_n_m = user.coupling.stiffness_n_m;
  if (wanted_n_m <= most_n_m) return;
  fmt::print(stderr,
             "subworld: {}: coupling.stiffness_n_m {:g} is more than a wall can have at this rate and delay before the "
             "device ({:g} kg, {:g} N s/m) swings: {:.3g} N/m at most with a damping of {:g} N s/m. Lower it, shorten h_s "
             "or the delay, or expect the passivity bound to soften it\n",
             user.name, wanted_n_m, user.device.mass_kg, user.device.damping_n_s_m, most_n_m,
             user.coupling.damping_n_s_m);
}

/// World and sub-worlds hear of each other once a cycle.
void warn_of_few_cycles(const Settings& s) {
  constexpr double kFew = 5.0;
  const double cycles = std::max(1.0, std::round(s.duration_s / s.shortest_cycle_s()));
  if (cycles >= kFew) return;
  fmt::print(stderr,
             "subworld: a cycle of the world takes {:g} s at ratio {}: world and sub-worlds exchange their states only "
             "{} time{} in the {:g} s of the run; take a lower ratio or a longer duration\n",
             s.shortest_cycle_s(), s.ratio, cycles, cycles == 1.0 ? "" : "s", s.duration_s);
}

}  // namespace

void warn_of_settings(const Scene& scene) {
  warn_of_small_boxes("world", scene.settings.world, scene);
  warn_of_small_boxes("haptic", scene.settings.haptic, scene);
  warn_of_few_cycles(scene.settings);
  for (const UserSpec& user : scene.users) warn_of_stiffness(user, scene.settings);
}

namespace {

std::string cycle_text(const Settings& s) {
  if (!s.adapts_ratio()) return fmt::format("{:g} ms", 1e3 * s.shortest_cycle_s());
  return fmt::format("{:g} to {:g} ms, by what the hand feels and what the world costs", 1e3 * s.shortest_cycle_s(),
                     1e3 * s.longest_cycle_s());
}

}  // namespace

void print_plan(const Scene& scene, bool gui) {
  const Settings& s = scene.settings;
  warn_of_settings(scene);
  const auto scheme = make_scheme(s);
  const std::string engines = describe_engine("world", s.world) + describe_engine("sub-worlds", s.haptic);
  const auto fixed = std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.fixed(); });
  const bool realtime = s.mode == Mode::realtime;
  fmt::print("{}: {} movable and {} fixed bodies, {} of {} users\n", scene.name,
             static_cast<long>(scene.bodies.size()) - fixed, fixed, s.users, scene.users.size());
  fmt::print("  processes: world_sim, {0} haptic_sim, {0} device_sim{1}\n", s.users, gui ? ", gui_headless" : "");
  fmt::print("  clock: {}; h = {:g} ms, r = {}, T = {}\n", realtime ? "real time" : "lock-step", 1e3 * s.h_s,
             to_text(s.ratio_bounds()), cycle_text(s));
  fmt::print("{}", engines);

  const auto decide = [](bool in, const char* what, const std::string& why) {
    fmt::print("  {} {}: {}\n", in ? "with   " : "without", what, why);
  };
  decide(scheme->border() != Border::none, "sub-worlds", fmt::format("scheme {}", scheme->name()));
  decide(realtime, "DDS deadlines", realtime ? "armed in real time" : "in lock-step nobody is late");
  decide(gui, "world_state", gui ? "the display reads it" : "nobody reads it, so no snapshot is gathered");
  decide(s.users > 1, "shared bodies", s.users > 1 ? "several sub-worlds may hold the same body" : "one user");
  for (int u = 0; u < s.users; ++u) {
    const UserSpec& user = scene.users[static_cast<std::size_t>(u)];
    const bool torques = user.device.degrees_of_freedom == 6;
    decide(torques, fmt::format("torques for user {}", u).c_str(),
           fmt::format("{} degrees of freedom", user.device.degrees_of_freedom));
    const bool spring = user.device.kind == DeviceKind::impedance;
    const bool passive = needs_passivity(s, user.device);
    decide(passive, fmt::format("passivity bound for user {}", u).c_str(),
           s.passivity != Passivity::automatic ? "as the scene or --passivity says"
           : passive                           ? "messages are delayed: a device could give its hand energy of nobody's"
                                               : "nothing is delayed: the bound would change nothing");
    decide(spring, fmt::format("virtual coupling for user {}", u).c_str(),
           spring ? "impedance device" : "admittance device: its force acts on the proxy");
  }
}

}  // namespace subworld
