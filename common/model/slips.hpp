#pragma once

#include <limits>
#include <string>
#include <string_view>

namespace subworld {

/// The interval that a number must lie in. `above` and `below` exclude the ends.
struct Limits {
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  bool above = false;
  bool below = false;

  [[nodiscard]] bool contains(double value) const noexcept {
    return (above ? value > least : value >= least) && (below ? value < most : value <= most);
  }
};

/// "at least 0 and below 1"; empty: all numbers.
[[nodiscard]] std::string to_text(const Limits& limits);

/// Unit of a part of 1; it is not printed.
inline constexpr const char* kPartUnit = "1";

/// The unit that the end of a key names: "duration_s" gives "s", "size_m[2]" gives "m"; empty: none.
[[nodiscard]] std::string_view unit_of(std::string_view key);

/// Where a value lies outside its limits in its unit (s, m, kg, Hz, m/s, N/m, deg, rad, or a part of 1), and inside
/// them if it was meant in a usual other unit: "; did you mean 0.05 (50 ms)?". Empty: no such unit.
[[nodiscard]] std::string likely_slip(double value, const Limits& limits, std::string_view unit);

}  // namespace subworld
