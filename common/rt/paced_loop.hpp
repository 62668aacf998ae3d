#pragma once

#include "rt/cyclic.hpp"
#include "rt/lateness.hpp"
#include "rt/stages.hpp"

#include <thread>

namespace subworld {

/// Common part of every real-time loop, around its step. It waits for the release, measures the lateness at the step's
/// start and end, decides the cause of a missed deadline, and marks the stages. A step is `wait`, `wake`, perhaps
/// `skip_missed`, `begin`, the work, perhaps `judge`, `end`.
template <class Enum>
class PacedLoop {
 public:
  /// Release n is at `start` + n `period_s`. `spin`: see Cyclic.
  PacedLoop(TimePoint start, double period_s, Duration spin, Stages<Enum>& stages) noexcept
      : cyclic_(start, from_seconds(period_s), spin), lateness_(thread_use()), stages_(stages) {}

  /// Waits for the next release. A loop that is a whole period behind first leaves its core for a tenth of its work:
  /// threads of lower priority deliver its messages there, and may run its device.
  void wait() noexcept {
    if (Clock::now() > cyclic_.deadline() + cyclic_.period()) {
      std::this_thread::sleep_for(lateness_.worked() / 10);
      lateness_.slept(thread_use());
    }
    asked_ = Clock::now();
    lateness_s_ = to_seconds(cyclic_.wait());
  }
  /// The step begins; its deadline is `period_s` after its release. Returns the number of whole periods that the OS has
  /// lost.
  int wake(double period_s) noexcept {
    woke_ = Clock::now();
    return lateness_.begin(cyclic_.released(), asked_, woke_, from_seconds(period_s));
  }
  /// Skips the releases whose period is over; returns their number.
  int skip_missed() noexcept {
    const int skipped = cyclic_.skip(woke_);
    lateness_.skipped_to(cyclic_.released());
    return skipped;
  }
  /// Begins the work.
  void begin() noexcept { stages_.begin(cyclic_.released(), woke_); }

  /// Cause of a miss of `deadline` by work of the current step that was finished at `now`.
  [[nodiscard]] Miss judge(TimePoint now, TimePoint deadline) const noexcept {
    return now > deadline ? lateness_.judge(now, deadline, thread_use()) : Miss::none;
  }
  /// Ends the step at `now`.
  void end(TimePoint now) noexcept { lateness_.end(now, thread_use()); }

  [[nodiscard]] TimePoint woke() const noexcept { return woke_; }
  [[nodiscard]] TimePoint released() const noexcept { return cyclic_.released(); }
  [[nodiscard]] TimePoint deadline() const noexcept { return cyclic_.deadline(); }
  /// From the release to the start of the step.
  [[nodiscard]] double lateness_s() const noexcept { return lateness_s_; }
  /// The share of the lateness that the OS caused.
  [[nodiscard]] double woken_late_s() const noexcept { return lateness_.woken_late_s(); }
  /// Shifts all following releases.
  void shift(double seconds) noexcept { cyclic_.shift(from_seconds(seconds)); }
  /// Lengthens the following periods by `ppm` (negative: shortens).
  void slew(double ppm) noexcept { cyclic_.slew(ppm); }

 private:
  Cyclic cyclic_;
  Lateness lateness_;
  Stages<Enum>& stages_;
  TimePoint asked_{}, woke_{};
  double lateness_s_ = 0.0;
};

}  // namespace subworld
