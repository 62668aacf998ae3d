#pragma once

#include <algorithm>

namespace subworld {

/// Simulated time that a loop owes (negative: is ahead by), because periods were lost or a cycle did not divide into
/// whole steps. It is made up for in steps that are a little longer, never by steps in a burst: those would only be
/// late themselves.
class Arrears {
 public:
  void owe(double s) noexcept { owed_s_ += s; }
  void forget() noexcept { owed_s_ = 0.0; }
  [[nodiscard]] double owed_s() const noexcept { return owed_s_; }

  /// The length of a step that ought to be `step_s`, where `left_s` are left of the cycle: half to five halves of it,
  /// and such that the cycle ends with a step.
  double step(double step_s, double left_s) noexcept {
    if (step_s <= 0.0) return 0.0;
    double dt = step_s + std::clamp(owed_s_ / kPayback, -0.5 * step_s, step_s);
    if (left_s - dt < 0.5 * step_s) dt = left_s;
    owed_s_ += step_s - dt;
    return dt;
  }

 private:
  static constexpr double kPayback = 8.0;  ///< steps in which most of it is made up for
  double owed_s_ = 0.0;
};

}  // namespace subworld
