#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

struct Scene;

/// What a scene may not need, and is left out then: the plan. An item is a row of saving_items() and a place that asks
/// leaves_out().
enum class Saving : std::uint8_t { rest, sway, friction, impulses, pairs, device, silence, passivity };

/// Whether a scene needs it.
struct Decision {
  bool left_out = false;
  bool ordered = false;  ///< by a setting of its own, which --keep does not overrule
  std::string because;   ///< the fact of the scene that decides
};

struct SavingItem {
  Saving saving;
  std::string_view name;   ///< for --keep
  std::string_view where;  ///< it acts
  std::string_view what;   ///< is left out, one line
  bool of_user;            ///< each user has a decision of its own
  Decision (*decide)(const Scene& scene, std::size_t user);
};
/// In the order of `Saving`.
[[nodiscard]] std::span<const SavingItem> saving_items() noexcept;

/// With what is kept in.
[[nodiscard]] Decision decision(const Scene& scene, Saving saving, std::size_t user = 0);
[[nodiscard]] inline bool leaves_out(const Scene& scene, Saving saving, std::size_t user = 0) {
  return decision(scene, saving, user).left_out;
}

struct PlannedItem {
  const SavingItem* item = nullptr;
  std::size_t user = 0;  ///< of those that are decided for each
  Decision decision;
};
/// Every item, by user where users differ.
[[nodiscard]] std::vector<PlannedItem> plan_of(const Scene& scene);

/// A set of them: those that are kept in, for comparison.
using Kept = std::uint32_t;
inline constexpr Kept kKeepNothing = 0, kKeepAll = ~Kept{0};
/// Names as in saving_items(), or "all". Throws `Error` (usage) that names the flag and those there are.
[[nodiscard]] Kept parse_kept(const std::vector<std::string>& names, std::string_view flag = "--keep");
[[nodiscard]] std::vector<std::string_view> kept_names(Kept set);
[[nodiscard]] constexpr Kept kept(Saving saving) noexcept { return Kept{1} << static_cast<unsigned>(saving); }
[[nodiscard]] constexpr bool keeps(Kept set, Saving saving) noexcept { return (set & kept(saving)) != 0; }

}  // namespace subworld
