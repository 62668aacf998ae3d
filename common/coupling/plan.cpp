#include "coupling/plan.hpp"

#include "coupling/schemes/scheme.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>

namespace subworld {

namespace {

Decision decide_rest(const Scene& scene, std::size_t) {
  const auto movable = std::ranges::count_if(scene.bodies, [](const Body& b) { return !b.fixed(); });
  const auto others = movable - scene.settings.users;
  if (others == 0) return {false, false, "nothing moves but the proxies"};
  return {true, false, fmt::format("{} may come to rest", others == 1 ? "a body" : fmt::format("{} bodies", others))};
}

Decision decide_sway(const Scene& scene, std::size_t) {
  if (disables(scene.settings.disabled, Optimisation::rest))
    return {false, true, "rest is disabled, so nothing may sleep"};
  if (scene.settings.world.gravity.isZero()) return {false, false, "there is no gravity"};
  if (!decide_rest(scene, 0).enabled) return {false, false, "nothing moves but the proxies"};
  return {true, false, "structures that no proxy reaches may come to rest"};
}

Decision decide_friction(const Scene& scene, std::size_t) {
  const auto rough = std::ranges::count_if(scene.bodies, [](const Body& b) { return b.material.friction > 0.0; });
  const auto all = static_cast<long>(scene.bodies.size());
  if (rough == all) return {false, false, "all bodies have friction"};
  if (rough < 2) return {true, false, "no two bodies have friction"};
  return {true, false, fmt::format("{} of {} bodies have no friction", all - rough, all)};
}

Decision decide_impulses(const Scene& scene, std::size_t) {
  const SchemeProperties& scheme = scheme_of(scene.settings).properties;
  if (scheme.weighs_impulses)
    return {false, false, fmt::format("scheme {} weighs the impulses of all contacts", scheme.name)};
  if (!scheme.has_sub_worlds) return {true, false, "there are no sub-worlds, so no border reads them"};
  return {true, false, "only the border of a sub-world reads them"};
}

Decision decide_pairs(const Scene& scene, std::size_t) {
  const SchemeProperties& scheme = scheme_of(scene.settings).properties;
  if (scheme.weighs_impulses)
    return {false, false, fmt::format("scheme {} reads the impulses of the whole border", scheme.name)};
  if (!scheme.has_sub_worlds) return {false, false, "there are no sub-worlds"};
  return {true, false, "for a body that the sub-world already holds, the number of contacts is enough"};
}

Decision decide_device(const Scene& scene, std::size_t) {
  const SchemeProperties& scheme = scheme_of(scene.settings).properties;
  if (!scheme.has_sub_worlds)
    return {false, false, fmt::format("scheme {} holds the world's proxy to the device", scheme.name)};
  if (scene.settings.users > 1 && scheme.replicates_peers)
    return {false, false, "the sub-worlds of other users move the proxy by it"};
  return {true, false, "only the user's own sub-world reads it"};
}

Decision decide_changes(const Scene& scene, std::size_t) {
  const SchemeProperties& scheme = scheme_of(scene.settings).properties;
  if (!scheme.has_sub_worlds) return {false, false, fmt::format("scheme {} sends little but the proxy", scheme.name)};
  return {true, false, "each side knows which messages the other one has used"};
}

Decision decide_overruled(const Scene& scene, std::size_t user) {
  const Scheme& scheme = scheme_of(scene.settings);
  if (!scheme.properties.has_sub_worlds) return {false, false, "there are no sub-worlds"};
  if (scheme.properties.weighs_impulses)
    return {false, false, fmt::format("scheme {} reads all states", scheme.properties.name)};
  const bool turns = scene.users[user].device.degrees_of_freedom == 6;
  for (const Owner owner : {Owner::user, Owner::peer, Owner::world}) {
    const Correction part = scheme.correction({.owner = owner, .turns_alone = turns}, {}, scene.settings);
    if (part.world != 0.0) return {false, false, fmt::format("scheme {} reads all states", scheme.properties.name)};
    if (part.world_turn != 0.0) return {false, false, "the world turns with a tool of six degrees of freedom"};
  }
  return {true, false, "the world decides on bodies whose island reaches out of the sub-world"};
}

Decision decide_suppression(const Scene& scene, std::size_t) {
  const Settings& s = scene.settings;
  const SchemeProperties& scheme = scheme_of(s).properties;
  if (!scheme.has_sub_worlds || scheme.weighs_impulses)
    return {false, false, fmt::format("scheme {} needs every message", scheme.name)};
  if (s.mode == Mode::realtime) return {false, false, "in real time messages carry the clock and the liveliness"};
  if (s.users > 1) return {false, false, "messages carry the other users' devices"};
  if (s.delay.any()) return {false, false, "delayed messages would arrive after a contact"};
  if (s.adapts_ratio()) return {false, false, "messages carry changes of the simulation ratio"};
  return {true, false, "while no body is near the only proxy, messages carry no information"};
}

Decision decide_energy_bound(const Scene& scene, std::size_t user) {
  const Settings& s = scene.settings;
  if (s.passivity == Passivity::on) return {false, true, "as the scene or --passivity says"};
  if (s.passivity == Passivity::off) return {true, true, "as the scene or --passivity says"};
  if (s.delay.any()) return {false, false, "messages are delayed, so a device could create energy"};
  if (s.remote && s.mode == Mode::realtime) return {false, false, "the network between the hosts may delay messages"};
  const bool follows_world = !scheme_of(s).properties.has_sub_worlds && s.largest_ratio() > 1;
  if (follows_world && scene.users[user].device.kind == DeviceKind::admittance)
    return {false, false, "the proxy of an admittance device lives in the world, which delays it by a cycle"};
  return {true, false, "no message is delayed, and a stable coupling needs no bound"};
}

/// In the order of `Optimisation`.
constexpr std::array kDecide{decide_rest,   decide_sway,    decide_friction,  decide_impulses,    decide_pairs,
                             decide_device, decide_changes, decide_overruled, decide_suppression, decide_energy_bound};

}  // namespace

Decision decision(const Scene& scene, Optimisation optimisation, std::size_t user) {
  Decision decision = kDecide[static_cast<std::size_t>(optimisation)](scene, user);
  if (decision.enabled && !decision.ordered && disables(scene.settings.disabled, optimisation)) {
    decision = {false, true, "as --disable says"};
  }
  return decision;
}

std::vector<PlannedItem> plan_of(const Scene& scene) {
  std::vector<PlannedItem> plan;
  for (const OptimisationItem& item : optimisation_items()) {
    const int decisions = item.of_user ? scene.settings.users : 1;
    for (std::size_t u = 0; u < static_cast<std::size_t>(decisions); ++u) {
      plan.push_back({&item, u, decision(scene, item.optimisation, u)});
    }
  }
  return plan;
}

}  // namespace subworld
