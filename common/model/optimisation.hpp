#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

struct Scene;

/// The plan: optimisations that a scene may permit. Each skips work, messages or memory that the scene does not need.
/// An optimisation is a row of optimisation_items() and the code that asks enabled().
enum class Optimisation : std::uint8_t { rest, sway, friction, impulses, pairs, device, suppression, passivity };

/// Whether the optimisation is on for a scene.
struct Decision {
  bool enabled = false;
  bool ordered = false;  ///< set by a setting of its own, which --disable does not overrule
  std::string because;   ///< the fact of the scene that decides
};

struct OptimisationItem {
  Optimisation optimisation;
  std::string_view name;   ///< as in --disable
  std::string_view where;  ///< programs or messages in which it acts
  std::string_view what;   ///< the skipped work, one line
  bool of_user;            ///< each user has a decision of its own
  Decision (*decide)(const Scene& scene, std::size_t user);
};
/// In the order of `Optimisation`.
[[nodiscard]] std::span<const OptimisationItem> optimisation_items() noexcept;

/// Whether the optimisation is on, with Settings::disabled taken into account.
[[nodiscard]] Decision decision(const Scene& scene, Optimisation optimisation, std::size_t user = 0);
[[nodiscard]] inline bool enabled(const Scene& scene, Optimisation optimisation, std::size_t user = 0) {
  return decision(scene, optimisation, user).enabled;
}

struct PlannedItem {
  const OptimisationItem* item = nullptr;
  std::size_t user = 0;  ///< 0 for an item without a decision for each user
  Decision decision;
};
/// Every item; one entry for each user where the decision is made for each user.
[[nodiscard]] std::vector<PlannedItem> plan_of(const Scene& scene);

/// A set of disabled optimisations.
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
