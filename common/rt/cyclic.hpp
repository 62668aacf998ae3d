#pragma once

#include <chrono>
#include <cstdint>

namespace subworld {

using Clock = std::chrono::steady_clock;
using TimePoint = Clock::time_point;
using Duration = std::chrono::nanoseconds;

[[nodiscard]] inline Duration from_seconds(double s) noexcept { return Duration(static_cast<std::int64_t>(s * 1e9)); }
[[nodiscard]] inline double to_seconds(Clock::duration d) noexcept { return std::chrono::duration<double>(d).count(); }
[[nodiscard]] inline std::int64_t to_ns(TimePoint t) noexcept {
  return std::chrono::duration_cast<Duration>(t.time_since_epoch()).count();
}

/// Absolute deadlines: release n is at start + n period, however long a step takes. The period may be slewed; past
/// releases are not affected.
class Cyclic {
 public:
  /// `spin`: how long before a release the loop stops sleeping and polls the clock; uses this share of a core.
  Cyclic(TimePoint start, Duration period, Duration spin = Duration::zero()) noexcept
      : next_(start), period_(period), spin_(spin) {}

  /// Waits until the next release and returns the lateness of the wake-up.
  Duration wait() noexcept;
  /// Skips the releases whose period is over at `now`, except the newest; returns their number.
  int skip(TimePoint now) noexcept;
  /// Deadline of the current step: the next release.
  [[nodiscard]] TimePoint deadline() const noexcept { return next_; }
  [[nodiscard]] TimePoint released() const noexcept { return released_; }
  [[nodiscard]] Duration period() const noexcept { return period_; }
  /// Lengthens the following periods by `ppm` (negative: shortens).
  void slew(double ppm) noexcept {
    slewed_ = Duration(static_cast<std::int64_t>(static_cast<double>(period_.count()) * (1.0 + 1e-6 * ppm)));
  }
  /// Shifts all following releases.
  void shift(Duration by) noexcept { next_ += by; }

 private:
  TimePoint next_;
  TimePoint released_{};
  Duration period_;
  Duration spin_;
  Duration slewed_ = period_;
};

}  // namespace subworld
