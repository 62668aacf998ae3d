#pragma once

#include "haptic_sim/sub_world.hpp"
#include "io/history.hpp"
#include "io/results.hpp"
#include "rt/histogram.hpp"

#include <string>

namespace subworld {

/// What a haptic process says of itself at the end, and its history on the way.
class HapticMeasures {
 public:
  /// `folder` may be empty: nothing is written.
  HapticMeasures(const std::string& folder, std::size_t user, History::Flush flush);

  /// After every step. `lateness_s`: of the wake-up; `missed`: the force left after its period ended. Zero in
  /// lock-step.
  void step(const SubWorld& sub, const FeltStep& felt, double step_s, double lateness_s, bool missed) noexcept;
  void synchronised(double seconds, std::uint64_t lost_frames) noexcept;
  void round_trip(double seconds) noexcept { round_trip_.add(seconds); }
  void resynchronised() noexcept { ++adoptions_; }

  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] std::uint64_t missed() const noexcept { return missed_; }

  [[nodiscard]] Json json(double bytes_per_cycle) const;

 private:
  std::size_t user_;
  History history_;
  Histogram step_, lateness_, sync_, round_trip_;
  MeanMax members_, contacts_, border_;
  std::uint64_t steps_ = 0, missed_ = 0, lost_frames_ = 0, adoptions_ = 0;
  double force_squares_ = 0.0, force_max_ = 0.0;
};

}  // namespace subworld
