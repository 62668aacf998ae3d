#pragma once

#include "io/results/results.hpp"
#include "lab/stability/plan.hpp"

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// See Compare. Not a number if `measured` is not a number.
[[nodiscard]] double error_of(Compare compare, double measured, double expected);

/// The row of one measurement; empty if a signal requested a stop. An engine that fails gives a row with the reason.
[[nodiscard]] std::optional<Json> measured_row(const StabilityPoint& point);

/// Error over tolerance: 1 is the bound. Infinite if the quantity could not be measured.
[[nodiscard]] double margin_of(const Json& row);
/// "12"; "<12" if even 12 did not hold, ">=12" if the search ended there; "failed" if there is no number.
[[nodiscard]] std::string measured_text(const Json& row);

/// Prints a line for each measurement, with the estimated remaining time. The estimate scales the time of a case in
/// earlier settings by the number of steps.
class StabilityProgress {
 public:
  explicit StabilityProgress(const std::vector<StabilityPoint>& points) : points_(points) {}
  /// The next point is done.
  void after(const Json& row);

 private:
  using Clock = std::chrono::steady_clock;
  struct Rate {
    double work = 0.0;
    double seconds = 0.0;
  };
  [[nodiscard]] double left_s() const;

  const std::vector<StabilityPoint>& points_;
  std::size_t done_ = 0;
  std::map<std::string, Rate> rates_;  ///< by label; "" for all
  Clock::time_point began_ = Clock::now();
};

}  // namespace subworld
