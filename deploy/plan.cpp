#include "coupling/passivity.hpp"
#include "coupling/scheme.hpp"
#include "launch.hpp"
#include "limits.hpp"
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

std::string cycle_text(const Settings& s) {
  if (!s.adapts_ratio()) return fmt::format("{:g} ms", 1e3 * s.shortest_cycle_s());
  return fmt::format("{:g} to {:g} ms, by what the hand feels and what the world costs", 1e3 * s.shortest_cycle_s(),
                     1e3 * s.longest_cycle_s());
}

}  // namespace

void print_plan(const RunRequest& request) {
  const Scene scene = load_scene(request.options);
  const Settings& s = scene.settings;
  const bool gui = request.gui;
  check_request(scene, request);
  warn_of_limits(scene);
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
  const bool rests = s.leaves_out(Saving::rest);
  decide(!rests, "bodies that rest (rest)",
         rests ? "the world does not simulate, tell or send those that nothing can reach; --keep rest simulates them"
               : "as --keep says");
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
