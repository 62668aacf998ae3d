#include "limits.hpp"

#include "coupling/plan.hpp"
#include "coupling/scheme.hpp"
#include "coupling/stiffness.hpp"
#include "launch.hpp"
#include "model/body_choice.hpp"
#include "model/error.hpp"
#include "model/shape_extent.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace subworld {

namespace {

/// An engine of the scene, where it acts and in which steps.
struct Place {
  const char* name;  ///< as in `settings`
  const EngineSettings& settings;
  const EnginePlugin& plugin;
  double step_s;
};

void warn_of_small_boxes(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const double unit_m = at.settings.length_unit_m;
  const double smallest_m = at.plugin.limits.smallest_box * unit_m;
  const auto small = std::ranges::find_if(scene.bodies, [&](const Body& body) {
    return body.shape.kind == ShapeKind::box && 2.0 * body.shape.half_extents.minCoeff() < smallest_m;
  });
  if (small == scene.bodies.end()) return;
  out.push_back(fmt::format(
      "{0}: {1} does not hold boxes with a side below {2:g} m in a unit of length of {3:g} m, as {4} has; it may fall "
      "through the floor. Set {0}.length_unit_m: {5:g}, or choose another engine",
      at.name, at.plugin.name, smallest_m, unit_m, small->name, 0.1 * unit_m));
}

/// A body that begins beside the end of a plane.
void warn_of_the_planes_end(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const double half_m = at.plugin.limits.plane_half_side_m;
  if (std::isinf(half_m)) return;
  for (const Body& plane : scene.bodies) {
    if (plane.shape.kind != ShapeKind::plane) continue;
    const BodyState& place = scene.initial[index(plane.id)];
    for (const Body& body : scene.bodies) {
      const Vec3 from = place.orientation.conjugate() * (scene.initial[index(body.id)].position - place.position);
      if (body.fixed() || from.head<2>().cwiseAbs().maxCoeff() <= half_m) continue;
      out.push_back(
          fmt::format("{}: in {} the plane {} ends {:g} m from its position, and {} begins beyond. Move the "
                      "scene towards the plane's position, or choose another engine",
                      at.name, at.plugin.name, plane.name, half_m, body.name));
      return;
    }
  }
}

void warn_of_iterations(const Place& at, std::vector<std::string>& out) {
  const int most = at.plugin.limits.iterations;
  if (!at.settings.iterations || *at.settings.iterations <= most) return;
  if (most == 0) {
    out.push_back(
        fmt::format("{0}: {1} chooses the number of its iterations itself: {0}.iterations {2} changes "
                    "nothing. Set {0}.substeps instead",
                    at.name, at.plugin.name, *at.settings.iterations));
  } else {
    out.push_back(fmt::format("{0}: {1} makes at most {2} iterations, not {3}. Set {0}.substeps for more", at.name,
                              at.plugin.name, most, *at.settings.iterations));
  }
}

/// A body that lies on another at the start, and is so many times as heavy.
struct HeavyPair {
  const Body* upper;
  const Body* lower;
  double ratio;
};

/// The pair of the largest ratio above `limit`: boxes around them meet, and one centre is above the other.
std::optional<HeavyPair> heaviest_on_light_pair(const Scene& scene, const Vec3& gravity, double limit) {
  constexpr double kTouching = 0.02;  // of the lower body's thickness
  std::vector<const Body*> movable;
  for (const Body& body : scene.bodies) {
    if (!body.fixed()) movable.push_back(&body);
  }
  const auto by_mass = std::ranges::minmax_element(movable, {}, &Body::mass);
  if (movable.empty() || (*by_mass.max)->mass <= limit * (*by_mass.min)->mass) return {};

  std::vector<Box> boxes(scene.bodies.size());
  for (const Body* body : movable) {
    Box& box = boxes[index(body->id)] = bounds(body->shape, scene.initial[index(body->id)], scene.meshes);
    const Vec3 margin = Vec3::Constant(kTouching * thickness(body->shape, scene.meshes));
    box = {box.lower - margin, box.upper + margin};
  }
  const auto left = [&](const Body* body) { return boxes[index(body->id)].lower.x(); };
  std::ranges::sort(movable, {}, left);
  std::optional<HeavyPair> worst;
  for (std::size_t i = 0; i < movable.size(); ++i) {
    const Box& box = boxes[index(movable[i]->id)];
    for (std::size_t j = i + 1; j < movable.size() && left(movable[j]) <= box.upper.x(); ++j) {
      if (!box.meets(boxes[index(movable[j]->id)])) continue;
      const Body *upper = movable[i], *lower = movable[j];
      if (upper->mass < lower->mass) std::swap(upper, lower);
      const double ratio = upper->mass / lower->mass;
      if (ratio <= (worst ? worst->ratio : limit)) continue;
      const Vec3 up = scene.initial[index(upper->id)].position - scene.initial[index(lower->id)].position;
      if (up.dot(gravity) < 0.0) worst = HeavyPair{upper, lower, ratio};
    }
  }
  return worst;
}

void warn_of_heavy_on_light(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const EnginePreset& preset = at.plugin.presets[find_preset(at.plugin, at.settings.preset)];
  const double limit = heaviest_on_light(preset.heavy_on_light, at.step_s);
  if (std::isinf(limit)) return;
  const auto pair = heaviest_on_light_pair(scene, at.settings.gravity, limit);
  if (!pair) return;
  out.push_back(fmt::format(
      "{}: {} lies on {} and is {:.3g} times as heavy; {} {} holds about {:.2g} times in steps of {:g} ms, then the "
      "lower body sinks in. Choose another preset or engine (subworld lab stability, case heavy_carried), a shorter "
      "step, "
      "or a heavier {}",
      at.name, pair->upper->name, pair->lower->name, pair->ratio, at.plugin.name, preset.name, limit, 1e3 * at.step_s,
      pair->lower->name));
}

/// The two thinnest bodies, the thinner first; null where there are fewer.
std::array<const Body*, 2> thinnest_two(const Scene& scene) {
  std::array<const Body*, 2> two{};
  const auto thinner = [&](const Body& body, const Body* than) {
    return than == nullptr || thickness(body.shape, scene.meshes) < thickness(than->shape, scene.meshes);
  };
  for (const Body& body : scene.bodies) {
    if (thinner(body, two[0])) {
      two = {&body, two[0]};
    } else if (thinner(body, two[1])) {
      two[1] = &body;
    }
  }
  return two;
}

/// A body that jumps past the thinnest other one within a step, or is faster than the engine lets it be.
void warn_of_speed(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const EngineLimits& limits = at.plugin.limits;
  const auto speed = [&](const Body& body) { return scene.initial[index(body.id)].linear_velocity.norm(); };
  const std::array<const Body*, 2> thinnest = thinnest_two(scene);
  const auto spin = [&](const Body& body) { return scene.initial[index(body.id)].angular_velocity.norm(); };
  for (const Body& body : scene.bodies) {
    const double jump_m = speed(body) * at.step_s;
    if (limits.continuous || jump_m <= 0.5 * thickness(body.shape, scene.meshes)) continue;
    const Body* thin = thinnest[thinnest[0] == &body ? 1 : 0];
    if (!thin || jump_m <= thickness(thin->shape, scene.meshes) + 0.5 * thickness(body.shape, scene.meshes)) continue;
    out.push_back(fmt::format(
        "{}: {} moves {:.3g} m within a step of {:g} ms and may pass through {}, which is {:.3g} m thick: {} finds "
        "contacts where a step ends, not on the way. Shorten the step, thicken {}, or choose an engine that follows "
        "fast bodies (subworld lab stability, case tunnel_speed)",
        at.name, body.name, jump_m, 1e3 * at.step_s, thin->name, thickness(thin->shape, scene.meshes), at.plugin.name,
        thin->name));
    break;
  }
  const auto limit = [&](const char* verb, const auto& of, double most, const char* unit) {
    const auto over = std::ranges::find_if(scene.bodies, [&](const Body& body) { return of(body) > most; });
    if (over == scene.bodies.end()) return;
    out.push_back(fmt::format("{}: {} {} with {:g} {}, and {} allows {:g}: it is slowed down. Choose another engine",
                              at.name, over->name, verb, of(*over), unit, at.plugin.name, most));
  };
  limit("moves", speed, limits.speed_m_s, "m/s");
  limit("turns", spin, limits.spin_rad_s, "rad/s");
}

/// A wall is the hardest that a coupling can meet.
void warn_of_stiffness(const UserSpec& user, const Settings& settings, bool bound, std::vector<std::string>& out) {
  if (user.device.kind != DeviceKind::impedance) return;
  const double most_n_m = largest_stiffness(user, settings);
  const double wanted_n_m = user.coupling.stiffness_n_m;
  if (wanted_n_m <= most_n_m) return;
  const std::string bounded = bound ? ", or expect the passivity bound to soften it" : "";
  if (most_n_m == 0.0) {
    out.push_back(fmt::format(
        "{}: coupling.damping_n_s_m {:g} alone makes the device ({:g} kg, {:g} N s/m) swing in a wall at this rate and "
        "delay, whatever the stiffness. Lower it first, shorten h_s or the delay{}",
        user.name, user.coupling.damping_n_s_m, user.device.mass_kg, user.device.damping_n_s_m, bounded));
    return;
  }
  out.push_back(fmt::format(
      "{}: coupling.stiffness_n_m {:g} is more than a wall can have at this rate and delay before the device ({:g} kg, "
      "{:g} N s/m) swings: {:.3g} N/m at most with a damping of {:g} N s/m. Lower it, shorten h_s or the delay{}",
      user.name, wanted_n_m, user.device.mass_kg, user.device.damping_n_s_m, most_n_m, user.coupling.damping_n_s_m,
      bounded));
}

/// What engine bullet finds in contact at the start; nothing where it is not there or cannot hold a body.
std::vector<Contact> contacts_at_the_start(const Scene& scene) {
  constexpr double kInstant_s = 1e-6;
  EngineSettings settings;
  settings.gravity = scene.settings.world.gravity;
  try {
    const auto engine = make_engine(settings, scene.meshes);
    for (const Body& body : scene.bodies) {
      const bool later = std::ranges::any_of(
          scene.users, [&](const UserSpec& user) { return user.joins_late && user.proxy == body.id; });
      if (!later) engine->add(body, scene.initial[index(body.id)]);
    }
    engine->step(kInstant_s);
    return {engine->contacts().begin(), engine->contacts().end()};
  } catch (const Error&) {
    return {};  // the scene's own engines decide whether it runs
  }
}

/// Bodies that overlap, and bodies at rest that nothing holds.
void warn_of_the_start(const Scene& scene, std::vector<std::string>& out) {
  constexpr std::size_t kMostBodies = 5000;  // more take too long for a warning
  constexpr double kDeep = 0.05;             // of the thinner one's thickness
  if (scene.bodies.size() > kMostBodies) return;
  const std::vector<Contact> contacts = contacts_at_the_start(scene);
  if (contacts.empty()) return;
  const Contact* deepest = nullptr;
  std::vector<bool> touches(scene.bodies.size());
  for (const Contact& c : contacts) {
    touches[index(c.a)] = touches[index(c.b)] = true;
    const double thin_m =
        std::min(thickness(scene.body(c.a).shape, scene.meshes), thickness(scene.body(c.b).shape, scene.meshes));
    if (-c.distance > kDeep * thin_m && (!deepest || c.distance < deepest->distance)) deepest = &c;
  }
  if (deepest) {
    out.push_back(
        fmt::format("{} and {} overlap by {:.2g} m at the start: engines push them apart, which may throw them. "
                    "Move one of them",
                    scene.body(deepest->a).name, scene.body(deepest->b).name, -deepest->distance));
  }
  const auto hangs = std::ranges::find_if(
      scene.bodies, [&](const Body& body) { return body.at_rest && body.gravity && !touches[index(body.id)]; });
  if (hangs != scene.bodies.end()) {
    out.push_back(
        fmt::format("{} is at_rest and touches nothing: it hangs in the air until something comes near. Lower "
                    "it, or leave at_rest out",
                    hangs->name));
  }
}

constexpr int kMostParticipants = 32;  // of one domain on one host, as the back ends number them

/// That there is such an engine and preset. Throws `Error` (usage) that names the place.
void check_engine(const EngineSettings& settings, const std::string& where) {
  try {
    (void)make_engine(settings, {});
  } catch (const Error& error) {
    throw Error(error.code(), fmt::format("{}: {}", where, error.what()));
  }
}

/// World and sub-worlds hear of each other once a cycle.
void warn_of_few_cycles(const Settings& s, std::vector<std::string>& out) {
  constexpr double kFew = 5.0;
  const double cycles = std::max(1.0, std::round(s.duration_s / s.shortest_cycle_s()));
  if (cycles >= kFew) return;
  out.push_back(
      fmt::format("a cycle of the world takes {:g} s at ratio {}: world and sub-worlds exchange their states only {} "
                  "time{} in the {:g} s of the run; take a lower ratio or a longer duration",
                  s.shortest_cycle_s(), s.ratio, cycles, cycles == 1.0 ? "" : "s", s.duration_s));
}

/// What is asked for and not done.
void warn_of_disabled(const Scene& scene, std::vector<std::string>& out) {
  if (scene.settings.disabled == kDisableAll) return;
  for (const PlannedItem& planned : plan_of(scene)) {
    const bool asked = disables(scene.settings.disabled, planned.item->optimisation);
    if (!asked || !planned.decision.enabled || planned.user != 0) continue;
    out.push_back(fmt::format("--disable {} changes nothing: it is left out, {}. Leave one of the two away",
                              planned.item->name, planned.decision.because));
  }
}

}  // namespace

std::vector<std::string> beyond_limits(const Scene& scene) {
  const Settings& s = scene.settings;
  std::vector<std::string> out;
  for (const Place& at : {Place{"world", s.world, engine_plugin(s.world.name), s.shortest_cycle_s()},
                          Place{"haptic", s.haptic, engine_plugin(s.haptic.name), s.h_s}}) {
    warn_of_small_boxes(scene, at, out);
    warn_of_the_planes_end(scene, at, out);
    warn_of_iterations(at, out);
    warn_of_heavy_on_light(scene, at, out);
    warn_of_speed(scene, at, out);
  }
  for (std::size_t u = 0; u < scene.users.size(); ++u) {
    warn_of_stiffness(scene.users[u], s, !enabled(scene, Optimisation::passivity, u), out);
  }
  warn_of_the_start(scene, out);
  warn_of_few_cycles(s, out);
  warn_of_disabled(scene, out);
  return out;
}

void check_request(const Scene& scene, const RunRequest& request) {
  const int participants = 2 + 2 * scene.settings.users + (request.gui ? 1 : 0);  // with this one
  if (participants > kMostParticipants) {
    throw Error(
        ExitCode::usage,
        fmt::format(
            "--users {}: that needs {} processes, and a DDS domain holds {} on one machine; take fewer users, or start "
            "some programs by hand on other machines",
            scene.settings.users, participants, kMostParticipants));
  }
  for (const std::string& peer : request.options.network.peers) {
    if (peer.starts_with("-"))
      throw Error(ExitCode::usage, fmt::format("--peers: \"{}\" is no host; give hosts, separated by commas", peer));
  }
  if (request.options.bodies) (void)choose_bodies(scene, *request.options.bodies);
  (void)scheme_of(scene.settings);
  check_engine(scene.settings.world, request.options.engine ? "--engine" : scene.file + ": settings.world");
  check_engine(scene.settings.haptic,
               request.options.haptic_engine ? "--haptic-engine" : scene.file + ": settings.haptic");
}

void warn_of_limits(const Scene& scene) {
  for (const std::string& warning : beyond_limits(scene)) fmt::print(stderr, "subworld: {}\n", warning);
}

}  // namespace subworld
