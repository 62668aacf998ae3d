#pragma once

#include <functional>

namespace subworld {

/// Where to look for a limit, and how closely. All values are positive; `to` may lie below `from`.
struct Search {
  double from = 1.0;        ///< expected to hold
  double to = 10.0;         ///< the last value that is tried
  double stride = 2.0;      ///< ratio of neighbouring values on the way out
  double precision = 1.02;  ///< ratio of the two ends of the bracket at the end
};

/// Between a value that was seen to hold and one that was seen to fail.
struct Bracket {
  double held;          ///< not a number: not even the first value held
  double failed;        ///< not a number: every value held
  bool upwards = true;  ///< the search went to larger values
  int trials = 0;

  [[nodiscard]] bool inside() const;
  /// Geometric mean of both ends, or the one end that there is.
  [[nodiscard]] double middle() const;
  /// The last value that held; where none did, the first that was tried.
  [[nodiscard]] double proven() const;
};

/// Marches from `from` towards `to` until a value fails, so that the nearest limit is found where there are several;
/// then halves the bracket, on a logarithmic scale. Throws `std::invalid_argument` for a search that cannot end.
[[nodiscard]] Bracket find_limit(const Search& search, const std::function<bool(double)>& holds);

}  // namespace subworld
