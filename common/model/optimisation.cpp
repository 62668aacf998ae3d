#include "model/optimisation.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

namespace subworld {

namespace {

constexpr std::array kItems{
    OptimisationItem{Optimisation::rest, "rest", "world",
                     "steps, contacts and messages of bodies that rest where nothing can reach them", false},
    OptimisationItem{Optimisation::sway, "sway", "world", "swaying that cannot lift a body by 1 % of its thickness",
                     false},
    OptimisationItem{Optimisation::friction, "friction", "world, sub-worlds", "friction of contacts that have none",
                     false},
    OptimisationItem{Optimisation::impulses, "impulses", "world, sub-worlds",
                     "friction impulses of contacts that nobody reads", false},
    OptimisationItem{Optimisation::pairs, "pairs", "frames", "border pairs of bodies that the sub-world has", false},
    OptimisationItem{Optimisation::device, "device", "reports", "motion of the device", false},
    OptimisationItem{Optimisation::suppression, "suppression", "frames, reports",
                     "messages of cycles in which a hand is alone", false},
    OptimisationItem{Optimisation::passivity, "passivity", "device", "bound on the energy that the hand gets", true}};
static_assert(std::ranges::is_sorted(kItems, {}, &OptimisationItem::optimisation) &&
                  kItems.size() == static_cast<std::size_t>(Optimisation::passivity) + 1,
              "an item is found by its number");

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
