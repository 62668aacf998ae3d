#pragma once

#include <functional>

namespace subworld {

/// Range and precision of a search for a limit. All values are positive; `to` may be below `from`.
struct Search {
  double from = 1.0;        ///< first value, expected to hold
  double to = 10.0;         ///< last value
  double stride = 2.0;      ///< ratio of successive values before the bracket is found
  double precision = 1.02;  ///< ratio of the bracket's ends at the end
};

/// Interval between a value that held and one that failed.
struct Bracket {
  double held;          ///< not a number: even the first value failed
  double failed;        ///< not a number: every value held
  bool upwards = true;  ///< the search went to larger values
  int trials = 0;

  [[nodiscard]] bool inside() const;
  /// Geometric mean of both ends, or the only end.
  [[nodiscard]] double middle() const;
  /// The last value that held; if none did, the first value.
  [[nodiscard]] double proven() const;
};

/// Increases from `from` towards `to` until a value fails, so that the nearest of several limits is found. Then bisects
/// the bracket on a logarithmic scale. Throws `std::invalid_argument` for a search that cannot end.
[[nodiscard]] Bracket find_limit(const Search& search, const std::function<bool(double)>& holds);

}  // namespace subworld
