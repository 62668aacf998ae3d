#pragma once

#include <map>
#include <optional>
#include <vector>

namespace subworld {

/// Which delays are measured, in whole haptic steps of the round trip.
struct DelayRange {
  int largest = 500;
  double stride = 1.25;     ///< ratio of successive delays of the grid
  double precision = 1.05;  ///< ratio of the first delay that fails to the last within, where the search ends
  double phase = 0.0;       ///< 0 .. 1, by which the grid is shifted, in strides
};

/// Search for the largest delay that each user does not notice. The same run measures all users.
///
/// The error need not rise with the delay, so the search first measures a grid: 0, then delays in a geometric series,
/// upwards, until every user has failed and two more delays are measured, or the largest delay is. Then, for each
/// user, the interval from the last delay before the first failure to that failure is bisected on a logarithmic scale.
/// A delay that fails below an earlier failure moves the interval down.
class DelaySearch {
 public:
  DelaySearch(const DelayRange& range, std::size_t users);

  /// The delay to measure next, haptic steps; empty: all limits are found.
  [[nodiscard]] std::optional<int> next() const;
  /// The result of a run. `within`: by user; users of whom no limit can be found count as within.
  void add(int delay, const std::vector<bool>& within);
  /// At most so many runs.
  [[nodiscard]] std::size_t most() const;

 private:
  /// The interval that holds the user's limit; `failed` 0: no delay failed.
  struct Interval {
    int within = 0;
    int failed = 0;
  };
  [[nodiscard]] Interval interval_of(std::size_t user) const;
  [[nodiscard]] bool all_failed_long_ago() const;

  DelayRange range_;
  std::size_t users_;
  std::vector<int> grid_;
  std::map<int, std::vector<bool>> measured_;  ///< by delay
};

}  // namespace subworld
