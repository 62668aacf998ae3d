#include "plan/limits.hpp"

#include "device_sim/drivers.hpp"

#include "coupling/plan.hpp"
#include "coupling/schemes/scheme.hpp"
#include "coupling/tool/stiffness.hpp"
#include "model/error.hpp"
#include "model/scene/body_choice.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"
#include "physics/plugin.hpp"
#include "plan/start_warnings.hpp"
#include "run/run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace subworld {

namespace {

/// " (and 3 more)" beside one that is described.
std::string and_more(std::size_t all) { return all > 1 ? fmt::format(" (and {} more)", all - 1) : ""; }

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
  const std::vector<std::string> small = names_of(scene, [&](const Body& body) {
    return body.shape.kind == ShapeKind::box && 2.0 * body.shape.half_extents.minCoeff() < smallest_m;
  });
  if (small.empty()) return;
  out.push_back(
      fmt::format("{0}: {1} does not support boxes with a side below {2:g} m in a unit of length of {3:g} m; these may "
                  "fall through the floor: {4}. Set {0}.length_unit_m: {5:g}, or choose another engine",
                  at.name, at.plugin.name, smallest_m, unit_m, listed(small), 0.1 * unit_m));
}

/// Bodies that start beyond the end of a plane.
void warn_of_the_planes_end(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const double half_m = at.plugin.limits.plane_half_side_m;
  if (std::isinf(half_m)) return;
  for (const Body& plane : scene.bodies) {
    if (plane.shape.kind != ShapeKind::plane) continue;
    const BodyState& place = scene.initial[index(plane.id)];
    const std::vector<std::string> beyond = names_of(scene, [&](const Body& body) {
      const Vec3 from = place.orientation.conjugate() * (scene.initial[index(body.id)].position - place.position);
      return !body.fixed() && from.head<2>().cwiseAbs().maxCoeff() > half_m;
    });
    if (beyond.empty()) continue;
    out.push_back(
        fmt::format("{}: in {} the plane {} ends {:g} m from its position; these start beyond: {}. Move the scene "
                    "towards the plane's position, or choose another engine",
                    at.name, at.plugin.name, plane.name, half_m, listed(beyond)));
  }
}

/// Bodies so far from the origin that the engine's digits do not suffice for them.
void warn_of_far_bodies(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  constexpr double kFine = 1e-3;  // of a body's thickness
  double precision = 0.0;
  try {
    precision = make_engine(at.settings, scene.meshes)->capabilities().precision;
  } catch (const Error&) {
    return;  // named when the run begins
  }
  const auto rounding_m = [&](const Body& body) {
    return precision * scene.initial[index(body.id)].position.cwiseAbs().maxCoeff();
  };
  const std::vector<std::string> far = names_of(scene, [&](const Body& body) {
    return !body.fixed() && rounding_m(body) > kFine * thickness(body.shape, scene.meshes);
  });
  if (far.empty()) return;
  double most_m = 0.0;
  for (const Body& body : scene.bodies) most_m = std::max(most_m, body.fixed() ? 0.0 : rounding_m(body));
  out.push_back(
      fmt::format("{}: {} rounds positions to {:.1g} m so far from the origin, too coarse for {}; move the "
                  "scene to the origin, or choose an engine of double precision",
                  at.name, at.plugin.name, most_m, listed(far)));
}

void warn_of_iterations(const Place& at, std::vector<std::string>& out) {
  const int most = at.plugin.limits.iterations;
  if (!at.settings.iterations || *at.settings.iterations <= most) return;
  if (most == 0) {
    out.push_back(
        fmt::format("{0}: {1} chooses the number of its iterations itself: {0}.iterations {2} changes nothing. Set "
                    "{0}.substeps instead",
                    at.name, at.plugin.name, *at.settings.iterations));
  } else {
    out.push_back(fmt::format("{0}: {1} makes at most {2} iterations, not {3}. Set {0}.substeps for more", at.name,
                              at.plugin.name, most, *at.settings.iterations));
  }
}

/// A body that lies on another at the start, and is `ratio` times as heavy.
struct HeavyPair {
  const Body* upper;
  const Body* lower;
  double ratio;
};

/// The pair of the largest ratio above `limit`: their bounding boxes meet, and one centre is above the other.
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
      "{}: {} lies on {} and is {:.3g} times as heavy; {} {} supports about {:.2g} times in steps of {:g} ms; above, "
      "the lower body sinks in. Choose another preset or engine (subworld lab stability, case heavy_carried), a "
      "shorter step, or a heavier {}",
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

/// Bodies that jump past the thinnest other one within a step, or are faster than the engine allows.
void warn_of_speed(const Scene& scene, const Place& at, std::vector<std::string>& out) {
  const EngineLimits& limits = at.plugin.limits;
  const auto speed = [&](const Body& body) { return scene.initial[index(body.id)].linear_velocity.norm(); };
  const std::array<const Body*, 2> thinnest = thinnest_two(scene);
  const auto spin = [&](const Body& body) { return scene.initial[index(body.id)].angular_velocity.norm(); };
  const Body* fastest = nullptr;
  std::size_t jumping = 0;
  for (const Body& body : scene.bodies) {
    const double jump_m = speed(body) * at.step_s, half_m = 0.5 * thickness(body.shape, scene.meshes);
    if (limits.continuous || jump_m <= half_m) continue;
    const Body* thin = thinnest[thinnest[0] == &body ? 1 : 0];
    if (!thin || jump_m <= thickness(thin->shape, scene.meshes) + half_m) continue;
    ++jumping;
    if (!fastest || speed(body) > speed(*fastest)) fastest = &body;
  }
  if (fastest) {
    const Body* thin = thinnest[thinnest[0] == fastest ? 1 : 0];
    out.push_back(fmt::format(
        "{}: {} moves {:.3g} m within a step of {:g} ms{} and may pass through {}, which is {:.3g} m thick: {} finds "
        "contacts at the end of a step only. Shorten the step, thicken {}, or choose an engine that follows fast "
        "bodies (subworld lab stability, case tunnel_speed)",
        at.name, fastest->name, speed(*fastest) * at.step_s, 1e3 * at.step_s, and_more(jumping), thin->name,
        thickness(thin->shape, scene.meshes), at.plugin.name, thin->name));
  }
  const auto limit = [&](const char* verb, const auto& of, double most, const char* unit) {
    const auto over = std::ranges::max_element(scene.bodies, {}, of);
    if (over == scene.bodies.end() || of(*over) <= most) return;
    const auto all = static_cast<std::size_t>(
        std::ranges::count_if(scene.bodies, [&](const Body& body) { return of(body) > most; }));
    out.push_back(fmt::format("{}: {}{} {} with {:g} {}, and {} allows {:g}: it is slowed down. Choose another engine",
                              at.name, over->name, and_more(all), verb, of(*over), unit, at.plugin.name, most));
  };
  limit("moves", speed, limits.speed_m_s, "m/s");
  limit("turns", spin, limits.spin_rad_s, "rad/s");
}

/// A fixed wall needs the lowest stiffness of all contacts.
void warn_of_stiffness(const UserSpec& user, const Settings& settings, bool bound, std::vector<std::string>& out) {
  if (user.device.kind != DeviceKind::impedance) return;
  const double most_n_m = largest_stiffness(user, settings);
  const double wanted_n_m = user.coupling.stiffness_n_m;
  if (wanted_n_m <= most_n_m) return;
  const std::string bounded = bound ? ", or expect the passivity bound to soften it" : "";
  if (most_n_m == 0.0) {
    out.push_back(
        fmt::format("{}: coupling.damping_n_s_m {:g} alone makes the device ({:g} kg, {:g} N s/m) oscillate in a wall "
                    "at this rate and delay, whatever the stiffness. Lower it first, shorten h_s or the delay{}",
                    user.name, user.coupling.damping_n_s_m, user.device.mass_kg, user.device.damping_n_s_m, bounded));
    return;
  }
  out.push_back(fmt::format(
      "{}: coupling.stiffness_n_m {:g} is too high for a wall at this rate and delay: the device ({:g} kg, {:g} N s/m) "
      "oscillates above {:.3g} N/m with a damping of {:g} N s/m. Lower it, shorten h_s or the delay{}",
      user.name, wanted_n_m, user.device.mass_kg, user.device.damping_n_s_m, most_n_m, user.coupling.damping_n_s_m,
      bounded));
}

/// World and sub-worlds exchange messages once a cycle.
void warn_of_few_cycles(const Settings& s, std::vector<std::string>& out) {
  constexpr double kFew = 5.0;
  const double cycles = std::max(1.0, std::round(s.duration_s / s.shortest_cycle_s()));
  if (cycles >= kFew) return;
  out.push_back(
      fmt::format("a cycle of the world takes {:g} s at ratio {}: world and sub-worlds exchange their states only {} "
                  "time{} in the {:g} s of the run; take a lower ratio or a longer duration",
                  s.shortest_cycle_s(), s.ratio, cycles, cycles == 1.0 ? "" : "s", s.duration_s));
}

/// Requests of --disable without effect.
void warn_of_disabled(const Scene& scene, std::vector<std::string>& out) {
  if (scene.settings.disabled == kDisableAll) return;
  for (const PlannedItem& planned : plan_of(scene)) {
    const bool asked = disables(scene.settings.disabled, planned.item->optimisation);
    if (!asked || !planned.decision.enabled || planned.user != 0) continue;
    out.push_back(fmt::format("--disable {} changes nothing: another setting decides, {}", planned.item->name,
                              planned.decision.because));
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
    warn_of_far_bodies(scene, at, out);
    warn_of_iterations(at, out);
    warn_of_heavy_on_light(scene, at, out);
    warn_of_speed(scene, at, out);
  }
  for (std::size_t u = 0; u < scene.users.size(); ++u) {
    warn_of_stiffness(scene.users[u], s, !enabled(scene, Optimisation::energy_bound, u), out);
  }
  for (const std::string& refused : refused_bodies(scene, s.haptic))
    out.push_back(fmt::format("haptic: the run will fail once this body is in a sub-world: {}", refused));
  warn_of_slips(scene, out);
  warn_of_double_joints(scene, out);
  warn_of_the_start(scene, out);
  warn_of_few_cycles(s, out);
  warn_of_disabled(scene, out);
  return out;
}

std::string user_limit(int domain) {
  return fmt::format(
      "one host has room for {} users of a run: a DDS domain has UDP ports for {} participants on a host, and a run "
      "needs 2 for each user and {} more",
      user_room(domain), participant_room(domain), participants_of(0));
}

namespace {

/// What the device programs would refuse, before any program starts.
void check_devices(const Scene& scene, const Options& options) {
  for (int user = 0; user < scene.settings.users; ++user) {
    const std::vector<std::string> flags = device_flags_of(options, user);
    if (flags.empty() || flags[1] == kEmulated) continue;
    if (scene.settings.mode == Mode::lockstep) throw Error(ExitCode::usage, refused_in_lockstep(flags[1]));
    (void)driver_plugin(flags[1]);
  }
}

}  // namespace

void check_request(const Scene& scene, const RunRequest& request, int users_of_a_host) {
  const int domain = std::max(0, request.domain);
  if (users_of_a_host > user_room(domain)) {
    throw Error(ExitCode::usage, fmt::format("--users {}: {}; take fewer users, or several hosts: see subworld up",
                                             scene.settings.users, user_limit(domain)));
  }
  for (const std::string& peer : request.options.network.peers) {
    if (peer.starts_with("-"))
      throw Error(ExitCode::usage, fmt::format("--peers {}: is no host; give hosts, separated by commas", peer));
  }
  if (request.restart != Restart::never && scene.settings.mode == Mode::lockstep &&
      scene.settings.absent == Absent::end) {
    throw Error(ExitCode::usage,
                "--restart: a run in lock-step ends with the first of its programs; give --absent wait or --absent "
                "continue, or use --mode realtime");
  }
  check_devices(scene, request.options);
  if (request.options.bodies) (void)choose_bodies(scene, *request.options.bodies);
  const auto where = [&](const std::string& key, const std::string& in_file) {
    const std::string flag = flag_of(request.options, key);
    return flag.empty() ? scene.file + in_file : flag;
  };
  (void)scheme_of(scene.settings, where("scheme", ": settings.scheme"));
  const auto of_engine = [&](const std::string& of) {
    const bool preset = !flag_of(request.options, of + ".preset").empty();
    return where(of + (preset ? ".preset" : ".engine"), ": settings." + of);
  };
  check_engine(scene, scene.settings.world, of_engine("world"));
  check_engine(scene, scene.settings.haptic, of_engine("haptic"));
  std::string refusal;
  for (const std::string& refused : refused_bodies(scene, scene.settings.world))
    refusal += fmt::format("{}{}: {}", refusal.empty() ? "" : "\n", of_engine("world"), refused);
  if (!refusal.empty()) throw Error(ExitCode::usage, refusal);
  for (const std::string& warning : beyond_limits(scene)) fmt::print(stderr, "subworld: {}\n", warning);
}

}  // namespace subworld
