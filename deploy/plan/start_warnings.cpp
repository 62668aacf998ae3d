#include "plan/start_warnings.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"
#include "physics/plugin.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

namespace subworld {

namespace {

/// The contacts that engine bullet finds at the start; none where it is not installed or refuses a body.
std::vector<Contact> contacts_at_the_start(const Scene& scene) {
  constexpr double kInstant_s = 1e-6;
  EngineSettings settings;
  settings.gravity = scene.settings.world.gravity;
  try {
    const auto engine = make_engine(settings, scene.meshes);
    engine->set_joints(scene.joints);  // bodies that are joined may overlap
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

}  // namespace

std::string listed(const std::vector<std::string>& items) {
  constexpr std::size_t kMostListed = 10;  // in one warning
  const std::size_t shown = std::min(items.size(), kMostListed);
  const std::string text = joined(std::span(items).first(shown), ", ");
  return items.size() > shown ? fmt::format("{} and {} more", text, items.size() - shown) : text;
}

void warn_of_slips(const Scene& scene, std::vector<std::string>& out) {
  constexpr double kLightest = 0.1, kHeaviest = 1e5;           // kg/m^3; aerogel has 1, osmium 22,600
  constexpr double kLeastUsual = 10.0, kMostUsual = 25'000.0;  // kg/m^3
  struct Slip {
    const char* meant;
    double factor;  ///< of the density
    std::vector<std::string> bodies;
  };
  std::array slips{Slip{"were its measures meant in mm? Write them in m", 1e9, {}},
                   Slip{"were its measures meant in cm? Write them in m", 1e6, {}},
                   Slip{"was its mass meant in g? Write it in kg", 1e-3, {}}};
  for (const Body& body : scene.bodies) {
    const bool is_hull = body.shape.kind == ShapeKind::convex || body.shape.kind == ShapeKind::compound;
    const double volume_m3 = is_hull ? integrate(scene.meshes[body.shape.mesh]).volume : volume(body.shape);
    if (body.fixed() || volume_m3 <= 0.0) continue;
    const double density = body.mass / volume_m3;
    // A tool stands for what an operator moves, which is heavier than its tip.
    if (density > kHeaviest && std::ranges::any_of(scene.users, [&](const UserSpec& u) { return u.proxy == body.id; }))
      continue;
    if (density >= kLightest && density <= kHeaviest) continue;
    for (Slip& slip : slips) {
      const double meant = slip.factor * density;
      if ((slip.factor > 1.0) != (density < kLightest) || meant < kLeastUsual || meant > kMostUsual) continue;
      slip.bodies.push_back(fmt::format("{} ({:.2g} kg/m3)", body.name, density));
      break;
    }
  }
  for (const Slip& slip : slips) {
    if (!slip.bodies.empty())
      out.push_back(fmt::format("no material has the density of {}; {}", listed(slip.bodies), slip.meant));
  }
}

void warn_of_double_joints(const Scene& scene, std::vector<std::string>& out) {
  std::map<std::pair<std::optional<BodyId>, std::optional<BodyId>>, const Joint*> known;  // none: any fixed body
  std::vector<std::string> twice;
  for (const Joint& joint : scene.joints) {
    const bool breaks = std::isfinite(joint.break_force_n) || std::isfinite(joint.break_torque_n_m);
    if (joint.kind != JointKind::fixed || breaks) continue;
    const auto of = [&](BodyId id) { return scene.body(id).fixed() ? std::nullopt : std::optional(id); };
    const auto [first, is_new] = known.try_emplace(std::minmax(of(joint.a), of(joint.b)), &joint);
    if (is_new) continue;
    const bool turned = scene.body(joint.a).fixed();
    twice.push_back(fmt::format("{} and {} both fix {} to {}", first->second->name, joint.name,
                                scene.body(turned ? joint.b : joint.a).name,
                                of(joint.a) && of(joint.b) ? scene.body(joint.b).name : "fixed bodies"));
  }
  if (!twice.empty()) {
    out.push_back(fmt::format("joints {}: one is enough, and how two share the load is not determined. Remove one",
                              listed(twice)));
  }
}

void warn_of_the_start(const Scene& scene, std::vector<std::string>& out) {
  for (const DividedMesh& mesh : scene.divided) {
    if (mesh.error_m > mesh.concavity_m)
      out.push_back(
          fmt::format("{}: its convex parts are up to {:.2g} mm from the mesh; try another "
                      "decompose.concavity_m, or raise most_parts",
                      mesh.file, 1e3 * mesh.error_m));
  }
  constexpr std::size_t kMostBodies = 5000;  // more take too long for a warning
  constexpr double kDeep = 0.05;             // of the thinner one's thickness
  if (scene.bodies.size() > kMostBodies) return;
  const std::vector<Contact> contacts = contacts_at_the_start(scene);
  if (contacts.empty()) return;
  std::map<std::pair<BodyId, BodyId>, double> depths;  // m, of pairs that overlap
  std::vector<bool> touches(scene.bodies.size());
  for (const Contact& c : contacts) {
    touches[index(c.a)] = touches[index(c.b)] = true;
    const double a_m = thickness(scene.body(c.a).shape, scene.meshes),
                 b_m = thickness(scene.body(c.b).shape, scene.meshes);
    const double thin_m = std::min(a_m, b_m) > 0.0 ? std::min(a_m, b_m) : std::max(a_m, b_m);  // a flat mesh has none
    if (-c.distance <= kDeep * thin_m) continue;
    double& depth_m = depths[std::minmax(c.a, c.b)];
    depth_m = std::max(depth_m, -c.distance);
  }
  if (!depths.empty()) {
    std::vector<std::pair<std::pair<BodyId, BodyId>, double>> deepest(depths.begin(), depths.end());
    std::ranges::stable_sort(deepest, std::greater{}, [](const auto& pair) { return pair.second; });
    std::vector<std::string> pairs;
    for (const auto& [bodies, depth_m] : deepest) {
      pairs.push_back(fmt::format("{} and {} overlap by {:.2g} m", scene.body(bodies.first).name,
                                  scene.body(bodies.second).name, depth_m));
    }
    out.push_back(
        fmt::format("at the start {}: engines push them apart, which may throw them. Move one of them", listed(pairs)));
  }
  const std::vector<std::string> hanging =
      names_of(scene, [&](const Body& body) { return body.at_rest && body.gravity && !touches[index(body.id)]; });
  if (!hanging.empty()) {
    out.push_back(
        fmt::format("{} {} at_rest and {} nothing: {} in the air until something comes near. Lower {}, or remove "
                    "at_rest",
                    listed(hanging), hanging.size() == 1 ? "is" : "are", hanging.size() == 1 ? "touches" : "touch",
                    hanging.size() == 1 ? "it hangs" : "they hang", hanging.size() == 1 ? "it" : "them"));
  }
}

void check_engine(const Scene& scene, const EngineSettings& settings, const std::string& where) {
  try {
    make_engine(settings, scene.meshes)->set_joints(scene.joints);
  } catch (const Error& error) {
    throw Error(error.code(), fmt::format("{}: {}", where, error.what()));
  }
}

std::vector<std::string> refused_bodies(const Scene& scene, const EngineSettings& settings) {
  std::vector<std::string> refused;
  std::set<std::tuple<ShapeKind, bool, bool, bool>> tried;
  for (const Body& body : scene.bodies) {
    if (!tried.insert({body.shape.kind, body.is_driven(), body.group != 0, resists_turning(body.material)}).second)
      continue;
    try {
      make_engine(settings, scene.meshes)->add(body, scene.initial[index(body.id)]);
    } catch (const Error& e) {
      refused.emplace_back(e.what());
    }
  }
  return refused;
}

}  // namespace subworld
