#pragma once

#include "io/results.hpp"
#include "lab/stability/plan.hpp"

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// See Compare. Not a number where `measured` is none.
[[nodiscard]] double error_of(Compare compare, double measured, double expected);

/// The row of one measurement; empty where a signal asked to stop. An engine that fails leaves a row with the reason.
[[nodiscard]] std::optional<Json> measured_row(const StabilityPoint& point);

/// Error over tolerance: 1 is the bound. Infinite where nothing could be measured.
[[nodiscard]] double margin_of(const Json& row);
/// "12"; "<12" where not even 12 held, ">=12" where the search ended there; "failed" where there is no number.
[[nodiscard]] std::string measured_text(const Json& row);

/// A line for each measurement, with the time that the rest may take: a case costs what it cost in the settings before,
/// by the number of steps.
class StabilityProgress {
 public:
  explicit StabilityProgress(const std::vector<StabilityPoint>& points) : points_(points) {}
  /// Done with the next point.
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
  std::map<std::string, Rate> rates_;  ///< by label; "" of all
  Clock::time_point began_ = Clock::now();
};

}  // namespace subworld
