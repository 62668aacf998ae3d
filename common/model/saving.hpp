#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// What a scene may not need, and is left out then. In the order of kSavings.
enum class Saving : std::uint8_t { rest };

struct SavingName {
  Saving saving;
  std::string_view name;  ///< for --keep
  std::string_view what;  ///< is left out, one line
};
inline constexpr std::array kSavings{
    SavingName{Saving::rest, "rest", "steps, contacts and messages of bodies that rest where nothing can reach them"}};

/// A set of them: those that are kept in, for comparison.
using Kept = std::uint32_t;
inline constexpr Kept kKeepNothing = 0, kKeepAll = ~Kept{0};
/// Names as in kSavings, or "all". Throws `Error` (usage) that names those there are.
[[nodiscard]] Kept parse_kept(const std::vector<std::string>& names);
[[nodiscard]] std::vector<std::string_view> kept_names(Kept set);
[[nodiscard]] constexpr Kept kept(Saving saving) noexcept { return Kept{1} << static_cast<unsigned>(saving); }

}  // namespace subworld
