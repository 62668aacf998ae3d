#pragma once

#include "model/messages/exchange.hpp"

#include <algorithm>

namespace subworld {

/// What a report sums up: of the user's impulse since the start, of the contacts and the step times since the last one.
class ReportTotals {
 public:
  /// How long a step took; 0: not known.
  void took(double seconds) noexcept {
    if (!(seconds > 0.0)) return;
    took_s_ += seconds;
    most_s_ = std::max(most_s_, seconds);
    ++timed_steps_;
  }
  /// The user's mean wrench on the proxy in a step of `dt` s.
  void add(const Wrench& mean, double dt) noexcept {
    impulse_.force += dt * mean.force;
    impulse_.torque += dt * mean.torque;
    indicators_.device_impulse_n_s += dt * mean.force.norm();
  }
  [[nodiscard]] Indicators& indicators() noexcept { return indicators_; }

  /// Adds them to a report; step times count anew.
  void take(HapticReport& report) noexcept {
    report.impulse_total = impulse_;
    report.indicators = indicators_;
    report.timing = {timed_steps_ > 0 ? took_s_ / timed_steps_ : 0.0, most_s_};
    took_s_ = most_s_ = 0.0;
    timed_steps_ = 0;
  }
  /// Contacts count anew.
  void begin_cycle() noexcept { indicators_ = {}; }

 private:
  Wrench impulse_;
  Indicators indicators_;
  double took_s_ = 0.0, most_s_ = 0.0;
  int timed_steps_ = 0;
};

}  // namespace subworld
