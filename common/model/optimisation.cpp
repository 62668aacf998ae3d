#include "model/optimisation.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"
#include "model/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

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
    return {false, true, "optimisation rest is off, so no body comes to rest"};
  if (scene.settings.world.gravity.isZero()) return {false, false, "there is no gravity, so no structure stands"};
  if (!decide_rest(scene, 0).enabled) return {false, false, "nothing moves but the proxies"};
  return {true, false, "structures that no operator reaches may come to rest"};
}

Decision decide_friction(const Scene& scene, std::size_t) {
  const auto rough = std::ranges::count_if(scene.bodies, [](const Body& b) { return b.material.friction > 0.0; });
  const auto all = static_cast<long>(scene.bodies.size());
  if (rough == all) return {false, false, "all bodies have friction"};
  if (rough < 2) return {true, false, "no two bodies have friction"};
  return {true, false, fmt::format("{} of {} bodies have no friction", all - rough, all)};
}

Decision decide_impulses(const Scene& scene, std::size_t) {
  if (scene.settings.blends_by_impulses()) return {false, false, "scheme paper weighs the impulses of all contacts"};
  if (!scene.settings.has_sub_worlds()) return {true, false, "there are no sub-worlds, so no border needs them"};
  return {true, false, "only the border of a sub-world needs them"};
}

Decision decide_pairs(const Scene& scene, std::size_t) {
  if (scene.settings.blends_by_impulses()) return {false, false, "scheme paper needs the impulses of its whole border"};
  if (!scene.settings.has_sub_worlds()) return {false, false, "there are no sub-worlds"};
  return {true, false, "the sub-world already has these bodies and needs only the counts"};
}

Decision decide_device(const Scene& scene, std::size_t) {
  const Settings& s = scene.settings;
  if (!s.has_sub_worlds()) return {false, false, "scheme direct moves the proxy by it"};
  if (s.users > 1 && !s.blends_by_impulses())
    return {false, false, "the sub-worlds of other users move the proxy by it"};
  return {true, false, "only the user's own sub-world reads it"};
}

Decision decide_suppression(const Scene& scene, std::size_t) {
  const Settings& s = scene.settings;
  if (!s.has_sub_worlds() || s.blends_by_impulses())
    return {false, false, fmt::format("scheme {} needs every message", s.scheme)};
  if (s.mode == Mode::realtime) return {false, false, "in real time they carry the clock and the sign of life"};
  if (s.users > 1) return {false, false, "they carry the motion of the other users"};
  if (s.delay.any()) return {false, false, "messages are delayed, so suppression would act late"};
  if (s.adapts_ratio()) return {false, false, "they carry changes of the simulation ratio"};
  return {true, false, "no body is near the only proxy, so they carry no information"};
}

Decision decide_passivity(const Scene& scene, std::size_t user) {
  const Settings& s = scene.settings;
  if (s.passivity == Passivity::on) return {false, true, "set by the scene or --passivity"};
  if (s.passivity == Passivity::off) return {true, true, "set by the scene or --passivity"};
  if (s.delay.any())
    return {false, false, "messages are delayed, so a device could deliver energy that the coupling did not store"};
  const bool follows_world = !s.has_sub_worlds() && s.largest_ratio() > 1;
  if (follows_world && scene.users[user].device.kind == DeviceKind::admittance)
    return {false, false, "the proxy of an admittance device is only in the world, which delays its motion by a cycle"};
  return {true, false, "no message is delayed, and a stable coupling needs no bound"};
}

constexpr std::array kItems{
    OptimisationItem{Optimisation::rest, "rest", "world",
                     "steps, contacts and messages of resting bodies that no other body can reach", false, decide_rest},
    OptimisationItem{Optimisation::sway, "sway", "world",
                     "oscillation of structures that cannot lift a body by 1 % of its thickness", false, decide_sway},
    OptimisationItem{Optimisation::friction, "friction", "world, sub-worlds",
                     "friction rows of contacts without friction", false, decide_friction},
    OptimisationItem{Optimisation::impulses, "impulses", "world, sub-worlds", "friction impulses that no border reads",
                     false, decide_impulses},
    OptimisationItem{Optimisation::pairs, "pairs", "frames", "border pairs of bodies that the sub-world already has",
                     false, decide_pairs},
    OptimisationItem{Optimisation::device, "device", "reports", "motion of the device", false, decide_device},
    OptimisationItem{Optimisation::suppression, "suppression", "frames, reports",
                     "messages of cycles in which no body is near the only proxy", false, decide_suppression},
    OptimisationItem{Optimisation::passivity, "passivity", "device", "bound on the energy that the operator receives",
                     true, decide_passivity}};
static_assert(std::ranges::is_sorted(kItems, {}, &OptimisationItem::optimisation) &&
                  kItems.size() == static_cast<std::size_t>(Optimisation::passivity) + 1,
              "the index of an item is its number");

}  // namespace

std::span<const OptimisationItem> optimisation_items() noexcept { return kItems; }

Decision decision(const Scene& scene, Optimisation optimisation, std::size_t user) {
  Decision decision = kItems[static_cast<std::size_t>(optimisation)].decide(scene, user);
  if (decision.enabled && !decision.ordered && disables(scene.settings.disabled, optimisation)) {
    decision = {false, true, "disabled by --disable"};
  }
  return decision;
}

std::vector<PlannedItem> plan_of(const Scene& scene) {
  std::vector<PlannedItem> plan;
  for (const OptimisationItem& item : kItems) {
    const int decisions = item.of_user ? scene.settings.users : 1;
    for (std::size_t u = 0; u < static_cast<std::size_t>(decisions); ++u) {
      plan.push_back({&item, u, decision(scene, item.optimisation, u)});
    }
  }
  return plan;
}

Disabled parse_disabled(const std::vector<std::string>& names, std::string_view flag) {
  std::vector<std::string_view> known{"all"};
  for (const OptimisationItem& item : kItems) known.push_back(item.name);
  Disabled set = kDisableNothing;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(kItems, name, &OptimisationItem::name);
    if (found == kItems.end() && name != "all") {
      const std::string_view meant = nearest(name, known);
      throw Error(ExitCode::usage, fmt::format("{}: there is no item \"{}\"; {}choose of: {}", flag, name,
                                               meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant),
                                               fmt::join(known, ", ")));
    }
    set |= name == "all" ? kDisableAll : disabled(found->optimisation);
  }
  return set;
}

std::vector<std::string_view> disabled_names(Disabled set) {
  std::vector<std::string_view> names;
  for (const OptimisationItem& item : kItems) {
    if (disables(set, item.optimisation)) names.push_back(item.name);
  }
  return names;
}

}  // namespace subworld
