#pragma once

#include <algorithm>
#include <utility>

namespace subworld {

/// Simulated time by which a loop is behind (negative: ahead), because periods were lost or a cycle is not a whole
/// number of steps. The loop catches up with slightly longer steps. A burst of additional steps would itself be late.
class Arrears {
 public:
  void owe(double s) noexcept { owed_s_ += s; }
  void forget() noexcept { owed_s_ = waiting_s_ = 0.0; }
  [[nodiscard]] double owed_s() const noexcept { return owed_s_ + waiting_s_; }

  /// Length of a step of nominally `step_s`, where `left_s` remain of the cycle: half to five halves of it, and such
  /// that the cycle ends with a step. Of a clock that is slowed below `whole_s` a step: that much in some steps,
  /// nothing in the others.
  double step(double step_s, double left_s, double whole_s = 0.0) noexcept {
    if (step_s <= 0.0) return 0.0;
    const double paid_s = std::clamp(owed_s_ / kPayback, -0.5 * step_s, step_s);
    owed_s_ -= paid_s;
    waiting_s_ += step_s + paid_s;
    const bool slowed = step_s < kSlowed * whole_s;
    if (slowed && waiting_s_ < whole_s) return 0.0;
    double dt = slowed ? whole_s : waiting_s_;
    if (left_s - dt < 0.5 * std::max(step_s, slowed ? whole_s : 0.0)) dt = left_s;
    waiting_s_ -= dt;
    if (!slowed) owed_s_ += std::exchange(waiting_s_, 0.0);
    return dt;
  }

 private:
  static constexpr double kPayback = 8.0;  ///< steps in which most of the time is caught up
  static constexpr double kSlowed = 0.9;   ///< closer to full speed, a step without motion would be felt
  double owed_s_ = 0.0;
  double waiting_s_ = 0.0;  ///< less than a whole step of a slowed clock
};

}  // namespace subworld
