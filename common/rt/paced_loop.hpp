#pragma once

#include "rt/cyclic.hpp"
#include "rt/lateness.hpp"
#include "rt/stages.hpp"

namespace subworld {

/// What every real-time loop does around its step: it waits for the release, measures how late the step begins and
/// ends, decides who missed a deadline, and marks the stages. A step is
/// `wait`, `wake`, perhaps `skip_missed`, `begin`, the work, perhaps `judge`, `end`.
template <class Enum>
class PacedLoop {
 public:
  /// Release n is at `start` + n `period_s`. `spin`: see Cyclic.
  PacedLoop(TimePoint start, double period_s, Duration spin, Stages<Enum>& stages) noexcept
      : cyclic_(start, from_seconds(period_s), spin), lateness_(thread_use()), stages_(stages) {}

  /// Waits for the next release.
  void wait() noexcept {
    asked_ = Clock::now();
    lateness_s_ = to_seconds(cyclic_.wait());
  }
  /// The step is there; its deadline lies `period_s` after its release. Returns how many whole periods passed because
  /// of the OS.
  int wake(double period_s) noexcept {
    woke_ = Clock::now();
    return lateness_.begin(cyclic_.released(), asked_, woke_, from_seconds(period_s));
  }
  /// Skips the releases whose period is over; returns how many.
  int skip_missed() noexcept {
    const int skipped = cyclic_.skip(woke_);
    lateness_.skipped_to(cyclic_.released());
    return skipped;
  }
  /// The work begins.
  void begin() noexcept { stages_.begin(cyclic_.released(), woke_); }

  /// Who missed `deadline` with what was done at `now`, in the step under way.
  [[nodiscard]] Miss judge(TimePoint now, TimePoint deadline) const noexcept {
    return now > deadline ? lateness_.judge(now, deadline, thread_use()) : Miss::none;
  }
  /// The step is over at `now`.
  void end(TimePoint now) noexcept { lateness_.end(now, thread_use()); }

  [[nodiscard]] TimePoint woke() const noexcept { return woke_; }
  [[nodiscard]] TimePoint released() const noexcept { return cyclic_.released(); }
  [[nodiscard]] TimePoint deadline() const noexcept { return cyclic_.deadline(); }
  /// From the release to the start of the step.
  [[nodiscard]] double lateness_s() const noexcept { return lateness_s_; }
  /// The part of the lateness for which the OS alone is the cause.
  [[nodiscard]] double woken_late_s() const noexcept { return lateness_.woken_late_s(); }
  /// Moves all coming releases.
  void shift(double seconds) noexcept { cyclic_.shift(from_seconds(seconds)); }
  /// Stretches the coming periods by `ppm`.
  void slew(double ppm) noexcept { cyclic_.slew(ppm); }

 private:
  Cyclic cyclic_;
  Lateness lateness_;
  Stages<Enum>& stages_;
  TimePoint asked_{}, woke_{};
  double lateness_s_ = 0.0;
};

}  // namespace subworld
