#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// Optimisations that a scene may permit (coupling/plan decides). An optimisation that is on skips work, messages or
/// memory that the scene does not need.
enum class Optimisation : std::uint8_t {
  rest,
  sway,
  friction,
  impulses,
  pairs,
  device,
  changes,
  overruled,
  suppression,
  energy_bound
};

struct OptimisationItem {
  Optimisation optimisation;
  std::string_view name;   ///< for --disable
  std::string_view where;  ///< the process or message that it concerns
  std::string_view what;   ///< the skipped work, one line
  bool of_user;            ///< decided for each user
};
/// In the order of `Optimisation`.
[[nodiscard]] std::span<const OptimisationItem> optimisation_items() noexcept;

/// Whether an optimisation is on for a scene.
struct Decision {
  bool enabled = false;
  bool ordered = false;  ///< set by a setting of its own, which --disable does not overrule
  std::string because;   ///< the fact of the scene that decides
};

struct PlannedItem {
  const OptimisationItem* item = nullptr;
  std::size_t user = 0;  ///< 0 for an item without a decision for each user
  Decision decision;
};

/// A set of optimisations that are off, for comparison.
using Disabled = std::uint32_t;
inline constexpr Disabled kDisableNothing = 0, kDisableAll = ~Disabled{0};
/// Names as in optimisation_items(), or "all". Throws `Error` (usage) that names the flag and the items.
[[nodiscard]] Disabled parse_disabled(const std::vector<std::string>& names, std::string_view flag = "--disable");
[[nodiscard]] std::vector<std::string_view> disabled_names(Disabled set);
[[nodiscard]] constexpr Disabled disabled(Optimisation optimisation) noexcept {
  return Disabled{1} << static_cast<unsigned>(optimisation);
}
[[nodiscard]] constexpr bool disables(Disabled set, Optimisation optimisation) noexcept {
  return (set & disabled(optimisation)) != 0;
}

}  // namespace subworld
