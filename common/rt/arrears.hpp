#pragma once

#include <algorithm>

namespace subworld {

/// Simulated time by which a loop is behind (negative: ahead), because periods were lost or a cycle is not a whole
/// number of steps. The loop catches up with slightly longer steps. A burst of additional steps would itself be late.
class Arrears {
 public:
  void owe(double s) noexcept { owed_s_ += s; }
  void forget() noexcept { owed_s_ = 0.0; }
  [[nodiscard]] double owed_s() const noexcept { return owed_s_; }

  /// Length of a step of nominally `step_s`, where `left_s` remain of the cycle: half to five halves of it, and such
  /// that the cycle ends with a step.
  double step(double step_s, double left_s) noexcept {
    if (step_s <= 0.0) return 0.0;
    double dt = step_s + std::clamp(owed_s_ / kPayback, -0.5 * step_s, step_s);
    if (left_s - dt < 0.5 * step_s) dt = left_s;
    owed_s_ += step_s - dt;
    return dt;
  }

 private:
  static constexpr double kPayback = 8.0;  ///< steps in which most of the time is caught up
  double owed_s_ = 0.0;
};

}  // namespace subworld
