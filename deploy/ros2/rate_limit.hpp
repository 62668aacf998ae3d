#pragma once

#include <algorithm>
#include <chrono>

namespace subworld::ros2 {

/// Lets messages pass at a mean rate, Hz, at most. Those of 10 ms may come at once.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;
  explicit RateLimit(double rate_hz) : period_(1.0 / rate_hz) {}
  bool passes(Clock::time_point time) {
    const Instant now = time;
    next_ = std::max<Instant>(next_, now - kAtOnce);
    if (now < next_) return false;
    next_ += period_;
    return true;
  }

 private:
  using Seconds = std::chrono::duration<double>;
  using Instant = std::chrono::time_point<Clock, Seconds>;
  static constexpr Seconds kAtOnce{0.01};
  Seconds period_;
  Instant next_{};
};

}  // namespace subworld::ros2
