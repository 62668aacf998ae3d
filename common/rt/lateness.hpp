#pragma once

#include "rt/cyclic.hpp"

#include <algorithm>
#include <cstdint>

namespace subworld {

/// CPU time and blocking of a thread since it started.
struct ThreadUse {
  Duration cpu{};             ///< on a core; excludes time that a hypervisor reports as stolen
  std::uint64_t blocked = 0;  ///< voluntary switches: the thread slept, or waited for a lock
};
/// Of the calling thread; two system calls, about a microsecond.
[[nodiscard]] ThreadUse thread_use() noexcept;

/// Cause of a missed deadline.
enum class Miss : std::uint8_t {
  none,
  os,         ///< the OS: in time if the kernel had run the loop when it was runnable
  computing,  ///< the run: the step took too long
  waiting,    ///< the run: the step took too long, and slept or waited for a lock
};

/// Separates lateness that the OS causes from lateness that the run causes. Time *withheld* by the OS is
///   * a late wake-up: from the release, or from when the loop began to wait if that was later, until it runs;
///   * a pre-emption: the part of a step's wall time in which the thread had no core, unless the step blocked
///   voluntarily;
///   * the share of both that made the step before end late and so the next one begin late.
/// A deadline missed by no more than the withheld time is missed by the OS, any other by the run.
class Lateness {
 public:
  /// `use`: of the loop's thread, before its first step.
  explicit Lateness(const ThreadUse& use) noexcept : before_(use) {}

  /// A step that was due at `released` begins: the loop began to wait at `asked` and runs since `woke`. Returns the
  /// number of whole periods that the OS alone has lost.
  int begin(TimePoint released, TimePoint asked, TimePoint woke, Duration period) noexcept {
    slept_ = asked < released;
    woken_late_ = woke - std::max(released, asked);
    withheld_ = std::clamp(asked - released, Duration::zero(), withheld_) + woken_late_;
    woke_ = woke;
    return periods(woke - released, period) - periods(woke - released - withheld_, period);
  }
  /// `released`: the newest release whose period is not over yet. Time withheld before it no longer counts.
  void skipped_to(TimePoint released) noexcept { withheld_ = std::min(withheld_, Duration(woke_ - released)); }

  /// Wake-up lateness of the current step that the OS caused, s.
  [[nodiscard]] double woken_late_s() const noexcept { return to_seconds(woken_late_); }

  /// Cause of a miss of `deadline` by work that was finished at `now`; `use`: of the thread at `now`.
  [[nodiscard]] Miss judge(TimePoint now, TimePoint deadline, const ThreadUse& use) const noexcept {
    if (now <= deadline) return Miss::none;
    if (now - withheld_ - preempted(now, use) <= deadline) return Miss::os;
    return waited(use) ? Miss::waiting : Miss::computing;
  }
  /// Ends the step.
  void end(TimePoint now, const ThreadUse& use) noexcept {
    withheld_ += preempted(now, use);
    worked_ = use.cpu - before_.cpu;
    before_ = use;
  }
  /// The thread has slept between two steps, by its own will.
  void slept(const ThreadUse& use) noexcept { before_ = use; }
  /// CPU time of the last step.
  [[nodiscard]] Duration worked() const noexcept { return worked_; }

 private:
  static int periods(Duration late, Duration period) noexcept {
    return late < Duration::zero() ? 0 : static_cast<int>(late / period);
  }
  /// The sleep until the release counts as one voluntary switch.
  [[nodiscard]] bool waited(const ThreadUse& use) const noexcept {
    return use.blocked > before_.blocked + (slept_ ? 1U : 0U);
  }
  [[nodiscard]] Duration preempted(TimePoint now, const ThreadUse& use) const noexcept {
    return waited(use) ? Duration::zero() : std::max(Duration::zero(), now - woke_ - (use.cpu - before_.cpu));
  }

  Duration withheld_{};  ///< time withheld by the OS, up to the current step
  Duration woken_late_{};
  Duration worked_{};
  TimePoint woke_{};
  bool slept_ = false;
  ThreadUse before_;  ///< at the end of the previous step
};

/// Missed deadlines by cause.
struct Misses {
  std::uint64_t by_os = 0;
  std::uint64_t by_run = 0;
  std::uint64_t waiting = 0;  ///< of by_run: the step slept or waited for a lock

  void add(Miss miss) noexcept {
    by_os += miss == Miss::os;
    by_run += miss == Miss::computing || miss == Miss::waiting;
    waiting += miss == Miss::waiting;
  }
  /// Adds skipped periods, `of_os` of them because of the OS.
  void skip(int all, int of_os) noexcept {
    const int os = std::clamp(of_os, 0, all);
    by_os += static_cast<std::uint64_t>(os);
    by_run += static_cast<std::uint64_t>(all - os);
  }
  [[nodiscard]] std::uint64_t all() const noexcept { return by_os + by_run; }
};

}  // namespace subworld
