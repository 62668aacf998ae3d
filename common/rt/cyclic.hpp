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

/// Absolute deadlines: release n is at start + n period, however long a step took. The period may be slewed; what was
/// released stays where it was.
class Cyclic {
 public:
  /// `spin`: how long before a release it stops sleeping and looks at the clock instead; it takes that much of a core.
  Cyclic(TimePoint start, Duration period, Duration spin = Duration::zero()) noexcept
      : next_(start), period_(period), spin_(spin) {}

  /// Waits until the next release and returns by how much it woke late.
  Duration wait() noexcept;
  /// Leaves out the releases whose period is over at `now`, so that the newest one counts; returns how many.
  int skip(TimePoint now) noexcept;
  /// When the step now released ought to be over.
  [[nodiscard]] TimePoint deadline() const noexcept { return next_; }
  [[nodiscard]] TimePoint released() const noexcept { return released_; }
  /// Stretches the coming periods by `ppm` (negative: shortens).
  void slew(double ppm) noexcept {
    slewed_ = Duration(static_cast<std::int64_t>(static_cast<double>(period_.count()) * (1.0 + 1e-6 * ppm)));
  }
  /// Moves all coming releases.
  void shift(Duration by) noexcept { next_ += by; }

 private:
  TimePoint next_;
  TimePoint released_{};
  Duration period_;
  Duration spin_;
  Duration slewed_ = period_;
};

}  // namespace subworld
