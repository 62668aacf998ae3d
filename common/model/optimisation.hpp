#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

struct Scene;

/// What a scene may not need, and is left out then: the plan. An item is a row of optimisation_items() and a place that
/// asks enabled().
enum class Optimisation : std::uint8_t { rest, sway, friction, impulses, pairs, device, suppression, passivity };

/// Whether a scene needs it.
struct Decision {
  bool enabled = false;
  bool ordered = false;  ///< by a setting of its own, which --disable does not overrule
  std::string because;   ///< the fact of the scene that decides
};

struct OptimisationItem {
  Optimisation optimisation;
  std::string_view name;   ///< for --disable
  std::string_view where;  ///< it acts
  std::string_view what;   ///< is left out, one line
  bool of_user;            ///< each user has a decision of its own
  Decision (*decide)(const Scene& scene, std::size_t user);
};
/// In the order of `Optimisation`.
[[nodiscard]] std::span<const OptimisationItem> optimisation_items() noexcept;

/// With what is kept in.
[[nodiscard]] Decision decision(const Scene& scene, Optimisation optimisation, std::size_t user = 0);
[[nodiscard]] inline bool enabled(const Scene& scene, Optimisation optimisation, std::size_t user = 0) {
  return decision(scene, optimisation, user).enabled;
}

struct PlannedItem {
  const OptimisationItem* item = nullptr;
  std::size_t user = 0;  ///< of those that are decided for each
  Decision decision;
};
/// Every item, by user where users differ.
[[nodiscard]] std::vector<PlannedItem> plan_of(const Scene& scene);

/// A set of them: those that are kept in, for comparison.
using Disabled = std::uint32_t;
inline constexpr Disabled kDisableNothing = 0, kDisableAll = ~Disabled{0};
/// Names as in optimisation_items(), or "all". Throws `Error` (usage) that names the flag and those there are.
[[nodiscard]] Disabled parse_disabled(const std::vector<std::string>& names, std::string_view flag = "--disable");
[[nodiscard]] std::vector<std::string_view> disabled_names(Disabled set);
[[nodiscard]] constexpr Disabled disabled(Optimisation optimisation) noexcept {
  return Disabled{1} << static_cast<unsigned>(optimisation);
}
[[nodiscard]] constexpr bool disables(Disabled set, Optimisation optimisation) noexcept {
  return (set & disabled(optimisation)) != 0;
}

}  // namespace subworld
