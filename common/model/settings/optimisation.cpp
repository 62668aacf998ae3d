#include "model/settings/optimisation.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>

namespace subworld {

namespace {

constexpr std::array kItems{
    OptimisationItem{Optimisation::rest, "rest", "world",
                     "steps, contacts and messages of resting bodies that no other body can reach", false},
    OptimisationItem{Optimisation::sway, "sway", "world",
                     "oscillation of structures that cannot lift a body by 1 % of its thickness", false},
    OptimisationItem{Optimisation::friction, "friction", "world, sub-worlds",
                     "friction rows of contacts without friction", false},
    OptimisationItem{Optimisation::impulses, "impulses", "world, sub-worlds", "friction impulses that no border reads",
                     false},
    OptimisationItem{Optimisation::pairs, "pairs", "frames", "border pairs of bodies that the sub-world already has",
                     false},
    OptimisationItem{Optimisation::device, "device", "reports", "motion of the device", false},
    OptimisationItem{Optimisation::changes, "changes", "frames, reports",
                     "states, ghosts and lists that are as in a message that the receiver has confirmed", false},
    OptimisationItem{Optimisation::overruled, "overruled", "reports", "states of members that the world overrules",
                     true},
    OptimisationItem{Optimisation::suppression, "suppression", "frames, reports",
                     "messages of cycles in which no body is near the only proxy", false},
    OptimisationItem{Optimisation::energy_bound, "energy_bound", "device",
                     "bound on the energy that the operator receives", true}};
static_assert(std::ranges::is_sorted(kItems, {}, &OptimisationItem::optimisation) &&
                  kItems.size() == static_cast<std::size_t>(Optimisation::energy_bound) + 1,
              "the index of an item is its number");

}  // namespace

std::span<const OptimisationItem> optimisation_items() noexcept { return kItems; }

Disabled parse_disabled(const std::vector<std::string>& names, std::string_view flag) {
  std::vector<std::string_view> known{"all"};
  for (const OptimisationItem& item : kItems) known.push_back(item.name);
  Disabled set = kDisableNothing;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(kItems, name, &OptimisationItem::name);
    if (found == kItems.end() && name != "all") {
      const std::string_view meant = nearest(name, known);
      throw Error(ExitCode::usage,
                  fmt::format("{}{}there is no item \"{}\"; {}choose of: {}", flag, flag.empty() ? "" : ": ", name,
                              meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant), joined(known, ", ")));
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
