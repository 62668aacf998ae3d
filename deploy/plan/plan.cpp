#include "coupling/plan.hpp"
#include "coupling/schemes/scheme.hpp"
#include "model/joined.hpp"
#include "model/mechanisms.hpp"
#include "physics/plugin.hpp"
#include "plan/limits.hpp"
#include "run/run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

namespace {

/// Two lines: the engine, and its capabilities. Throws `Error` (usage) where the settings name no
/// engine or preset.
std::string describe_engine(const EngineSettings& settings) {
  const EnginePlugin& plugin = engine_plugin(settings.name);
  const std::size_t preset = find_preset(plugin, settings.preset);
  std::string asked;
  if (settings.iterations) asked += fmt::format("; here {} iterations", *settings.iterations);
  if (settings.substeps) asked += fmt::format("; here {} sub-steps", *settings.substeps);
  if (settings.longest_substep_s)
    asked += fmt::format("; here sub-steps of at most {:g} ms", 1e3 * *settings.longest_substep_s);
  const auto fidelity = [](Fidelity of) {
    return std::array{"none", "estimated", "exact"}[static_cast<std::size_t>(of)];
  };
  const Capabilities can = make_engine(settings, {})->capabilities();
  return fmt::format(
      "engine {} ({}; licence {}), preset {}: {}{}\n"
      "    normal impulses {}, friction impulses {}, gyroscopic torque {}, joints {}, checkpoint {}, {}; unit of "
      "length {:g} m\n",
      plugin.name, plugin.version, plugin.licence, settings.preset, plugin.presets[preset].what, asked,
      fidelity(can.normal_impulse), fidelity(can.tangential_impulse), fidelity(can.gyroscopic), fidelity(can.joints),
      fidelity(can.checkpoint), can.deterministic ? "deterministic" : "not deterministic", settings.length_unit_m);
}

std::string cycle_text(const Settings& s) {
  if (!s.adapts_ratio()) return fmt::format("{:g} ms", 1e3 * s.shortest_cycle_s());
  return fmt::format("{:g} to {:g} ms, by what the operator feels and what the world costs", 1e3 * s.shortest_cycle_s(),
                     1e3 * s.longest_cycle_s());
}

constexpr std::size_t kContacts = 4;  ///< per body, for estimates

/// An estimate has two digits.
std::string short_text(double value) {
  return value < 99.5 ? fmt::format("{:.2g}", value) : fmt::format("{:.0f}", value);
}

std::size_t movable_bodies(const Scene& scene) {
  return static_cast<std::size_t>(std::ranges::count_if(scene.bodies, [](const Body& b) { return !b.fixed(); }));
}

/// An engine of the world by its published costs.
struct WorldEngine {
  EngineCost cost;
  double longest_s;  ///< of its steps

  WorldEngine(const Scene& scene, const EngineSettings& settings) : cost(engine_cost(settings)) {
    const auto engine = make_engine(settings, {});
    engine->set_joints(scene.joints);
    const Capabilities can = engine->capabilities();
    longest_s = can.drives_inside ? can.longest_step_s : scheme_of(scene.settings).properties.longest_world_step_s;
  }
  /// In a cycle, s.
  [[nodiscard]] double cycle_s(double cycle_s, std::size_t bodies, std::size_t contacts) const {
    const double steps = std::max(1.0, std::ceil(cycle_s / longest_s - 1e-9));
    return steps * cost.step(cycle_s / steps).of(bodies, contacts);
  }
};

/// The saving of an optimisation by the published costs of the engine; empty: not published.
std::string estimate(const Scene& scene, Optimisation optimisation) {
  if (optimisation != Optimisation::rest) return "";
  const Settings& s = scene.settings;
  const std::size_t movable = movable_bodies(scene);
  const auto proxies = static_cast<std::size_t>(s.users);
  const WorldEngine engine(scene, s.world);
  const auto cost_ms = [&](std::size_t bodies, std::size_t contacts) {
    return 1e3 * engine.cycle_s(s.shortest_cycle_s(), bodies, contacts);
  };
  return fmt::format(" (the engine takes {} ms a cycle while all bodies move, and {} ms when all rest)",
                     short_text(cost_ms(movable, kContacts * movable)), short_text(cost_ms(proxies, 0)));
}

constexpr double kRoom = 0.7;  ///< of a cycle, for the engine

/// Ways to the real-time factor 1 with cycles of this length, the nearest first.
std::string faster_engines(const Scene& scene, double cycle_s, std::size_t bodies) {
  constexpr int kMostThreads = 8;
  EngineSettings large = scene.settings.world;
  large.change_to("bullet_float", "large");
  for (const EngineSettings& settings : {scene.settings.world, large}) {
    WorldEngine engine(scene, settings);
    for (engine.cost.threads = 1; engine.cost.threads <= kMostThreads; engine.cost.threads *= 2) {
      if (engine.cycle_s(cycle_s, bodies, kContacts * bodies) > kRoom * cycle_s) continue;
      std::string flags = fmt::format("--engine {} --set world.preset={}", settings.name, settings.preset);
      if (engine.cost.threads > 1)
        flags += fmt::format(" and --world-threads {0}, on a machine with more than {0} cores", engine.cost.threads);
      return "choose " + flags;
    }
  }
  return "fewer bodies are real time";
}

/// Other choices, by the published costs of the engine while all bodies move.
std::vector<std::string> advice(const Scene& scene) {
  const Settings& s = scene.settings;
  const std::size_t movable = movable_bodies(scene);
  const WorldEngine engine(scene, s.world);
  const auto step_s = [&](double cycle_s) { return engine.cycle_s(cycle_s, movable, kContacts * movable); };
  const double longest_s = s.longest_cycle_s();
  if (step_s(longest_s) <= kRoom * longest_s) return {};
  const std::string problem = fmt::format("while all bodies move, the engine takes about {} ms of cycles of {:g} ms",
                                          short_text(1e3 * step_s(longest_s)), 1e3 * longest_s);
  int ratio = s.largest_ratio();
  while (ratio <= kMostRatio && step_s(ratio * s.h_s) > kRoom * ratio * s.h_s) ++ratio;
  constexpr double kLongest_s = 0.05;  // beyond it, the operator feels the delay of the world
  if (ratio * s.h_s <= kLongest_s)
    return {fmt::format("{}: for real time choose --ratio {}-{}", problem, s.ratio, ratio)};
  return {fmt::format("{}: in real time its clock slows to about {:.2g} until most of them rest; {}", problem,
                      std::min(1.0, kRoom * longest_s / step_s(longest_s)), faster_engines(scene, longest_s, movable))};
}

/// A feature that costs something, in use or saved.
struct Line {
  bool in;           ///< it is in use
  std::string name;  ///< of the optimisation, for --disable; empty: none
  std::string text;
};

std::vector<Line> lines_of(const Scene& scene, bool gui) {
  const Settings& s = scene.settings;
  const bool realtime = s.mode == Mode::realtime;
  std::vector<Line> lines;
  const auto of_user = [&](std::size_t u) { return s.users > 1 ? fmt::format("user {}: ", u) : std::string(); };
  for (const PlannedItem& planned : plan_of(scene)) {
    const OptimisationItem& item = *planned.item;
    const bool in = !planned.decision.enabled;
    const std::string what = in ? "" : fmt::format("no {}: ", item.what);
    lines.push_back({in, std::string(item.name),
                     (item.of_user ? of_user(planned.user) : "") + what + planned.decision.because +
                         (in ? "" : estimate(scene, item.optimisation))});
  }
  const bool has_sub_worlds = scheme_of(s).properties.has_sub_worlds;
  lines.push_back({has_sub_worlds, "", fmt::format("{}sub-worlds: scheme {}", has_sub_worlds ? "" : "no ", s.scheme)});
  lines.push_back({realtime, "", realtime ? "DDS deadlines on: real time" : "DDS deadlines off: lock-step"});
  lines.push_back(
      {gui, "",
       gui ? "snapshots of the world: the display reads them" : "no snapshots of the world: no display reads them"});
  if (s.users > 1) lines.push_back({true, "", "shared bodies: several sub-worlds may hold one"});
  for (std::size_t u = 0; u < static_cast<std::size_t>(s.users); ++u) {
    const DeviceSpec& device = scene.users[u].device;
    lines.push_back({device.degrees_of_freedom == 6, "",
                     fmt::format("{}{}torques: {} degrees of freedom", of_user(u),
                                 device.degrees_of_freedom == 6 ? "" : "no ", device.degrees_of_freedom)});
    const bool spring = device.kind == DeviceKind::impedance;
    lines.push_back(
        {spring, "",
         of_user(u) + (spring ? "virtual coupling: impedance device"
                              : "no virtual coupling: the force of an admittance device acts on the proxy")});
  }
  return lines;
}

/// Savings first, then what is in use.
void print(const std::vector<Line>& lines) {
  for (const bool in : {false, true}) {
    fmt::print("  {}\n", in ? "needed:" : "optimisations on (--disable NAME for those with a name):");
    for (const Line& line : lines) {
      if (line.in == in) fmt::print("    {:<11} {}\n", line.name, line.text);
    }
  }
}

/// Each setting with its value here; those of a user are of user 0.
void print_settings(Scene scene) {
  for (const Setting& one : settings_table()) {
    const std::string unit(one.unit() == kPartUnit ? "" : one.unit());
    fmt::print("{} = {} {}\n    {} (default {}{}{}{}; {})\n", one.key,
               value_text(one, scene.settings, scene.users.front()).value_or("unset"), unit, one.meaning,
               default_text(one), range_text(one).empty() ? "" : "; ", range_text(one),
               one.option.empty() ? "" : fmt::format("; {}", one.option), one.readers);
  }
}

/// "3 hinges and 1 slider; the largest mechanism has 4 bodies, ..."
std::string describe_joints(const Scene& scene) {
  std::map<std::string_view, std::size_t> kinds;
  for (const Joint& joint : scene.joints) ++kinds[name_of(joint.kind)];
  std::vector<std::string> parts;
  for (const auto& [kind, count] : kinds) parts.push_back(fmt::format("{} {}", count, kind));
  const Mechanisms mechanisms(scene);
  std::size_t largest = 1;
  for (const Body& body : scene.bodies) largest = std::max(largest, mechanisms.of(body.id).size());
  const Settings& s = scene.settings;
  const double step_s = engine_cost(s.haptic).step(s.h_s).of(largest, largest);
  const std::string cost = fmt::format("{:.2g} ms of a haptic step of {:g} ms", 1e3 * step_s, 1e3 * s.h_s);
  return fmt::format("{}; the largest mechanism has {} {}, which enter a sub-world together: {}{}", joined(parts, ", "),
                     largest, largest == 1 ? "body" : "bodies", cost,
                     step_s > s.h_s ? ": too many for real time; take a shorter chain or a longer h_s" : "");
}

}  // namespace

void print_plan(const RunRequest& request, bool settings) {
  const Scene scene = load_scene(request.options);
  if (settings) return print_settings(scene);
  const Settings& s = scene.settings;
  const bool gui = request.gui;
  check_request(scene, request, s.users);
  const std::string of_world = describe_engine(s.world), of_haptic = describe_engine(s.haptic);
  const std::size_t movable = movable_bodies(scene);
  const bool realtime = s.mode == Mode::realtime;
  fmt::print("{}: {} movable and {} fixed bodies, {} of {} users\n", scene.name, movable, scene.bodies.size() - movable,
             s.users, scene.users.size());
  if (!scene.joints.empty()) fmt::print("  joints: {}\n", describe_joints(scene));
  for (const DividedMesh& mesh : scene.divided) {
    fmt::print("  movable mesh {}: {} convex part(s), at most {:.2g} mm from it{}{}\n", mesh.file, mesh.parts,
               1e3 * mesh.error_m,
               mesh.error_m > mesh.concavity_m ? "; try another decompose.concavity_m, or raise most_parts" : "",
               mesh.cache.empty() ? "" : fmt::format(" ({})", mesh.cache));
  }
  fmt::print("  processes: world_sim, {0} haptic_sim, {0} device_sim{1}\n", s.users, gui ? ", gui_headless" : "");
  fmt::print("  limit: {}; a scene has at most {} users\n", user_limit(std::max(0, request.domain)), kMostUsers);
  fmt::print("  clock: {}; h = {:g} ms, r = {}, T = {}\n", realtime ? "real time" : "lock-step", 1e3 * s.h_s,
             to_text(s.ratio_bounds()), cycle_text(s));
  if (of_world == of_haptic) {
    fmt::print("  world and sub-worlds: {}", of_world);
  } else {
    fmt::print("  world: {}  sub-worlds: {}", of_world, of_haptic);
  }
  print(lines_of(scene, gui));
  for (const std::string& line : advice(scene)) fmt::print("  advice: {}\n", line);
}

}  // namespace subworld
