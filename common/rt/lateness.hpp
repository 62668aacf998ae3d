#pragma once

#include "rt/cyclic.hpp"

#include <algorithm>
#include <cstdint>

namespace subworld {

/// What a thread has used so far.
struct ThreadUse {
  Duration cpu{};             ///< on a core; time stolen by a hypervisor that says so is not in it
  std::uint64_t blocked = 0;  ///< times that it let go of the core by itself: slept, or waited for a lock
};
/// Of the calling thread; two system calls, about a microsecond.
[[nodiscard]] ThreadUse thread_use() noexcept;

/// Who missed a deadline.
enum class Miss : std::uint8_t {
  none,
  os,         ///< in time, had the kernel let the loop run when it could
  computing,  ///< the step took too long
  waiting,    ///< the step took too long, and slept or waited for a lock meanwhile
};

/// Tells the machine's lateness from a loop's own. The machine *keeps* from the loop
///  * a late wake-up: from the release, or from when the loop asked for it if that was later, until it runs;
///  * a pre-emption: the part of a step's wall time in which the thread had no core, unless the step let go of it by
///    itself;
///  * of both, what made the step before end late and so the next one begin late.
/// A deadline missed by no more than what was kept is the machine's, any other ours.
class Lateness {
 public:
  /// `use`: of the loop's thread, before its first step.
  explicit Lateness(const ThreadUse& use) noexcept : before_(use) {}

  /// A step that was due at `released` begins: the loop had asked for it at `asked` and runs since `woke`. Returns how
  /// many whole periods the machine alone has let pass.
  int begin(TimePoint released, TimePoint asked, TimePoint woke, Duration period) noexcept {
    slept_ = asked < released;
    woken_late_ = woke - std::max(released, asked);
    kept_ = std::clamp(asked - released, Duration::zero(), kept_) + woken_late_;
    woke_ = woke;
    return periods(woke - released, period) - periods(woke - released - kept_, period);
  }
  /// The newest release whose period is not over yet; what was kept before it counts no more.
  void skipped_to(TimePoint released) noexcept { kept_ = std::min(kept_, Duration(woke_ - released)); }

  /// How long the machine let the wake-up of the step under way wait.
  [[nodiscard]] double woken_late_s() const noexcept { return to_seconds(woken_late_); }

  /// Who missed the deadline of what was done at `now`; `use`: of the thread then.
  [[nodiscard]] Miss judge(TimePoint now, TimePoint deadline, const ThreadUse& use) const noexcept {
    if (now <= deadline) return Miss::none;
    if (now - kept_ - preempted(now, use) <= deadline) return Miss::os;
    return waited(use) ? Miss::waiting : Miss::computing;
  }
  /// The step is over.
  void end(TimePoint now, const ThreadUse& use) noexcept {
    kept_ += preempted(now, use);
    before_ = use;
  }

 private:
  static int periods(Duration late, Duration period) noexcept {
    return late < Duration::zero() ? 0 : static_cast<int>(late / period);
  }
  /// The sleep until the release is one time of letting go.
  [[nodiscard]] bool waited(const ThreadUse& use) const noexcept {
    return use.blocked > before_.blocked + (slept_ ? 1U : 0U);
  }
  [[nodiscard]] Duration preempted(TimePoint now, const ThreadUse& use) const noexcept {
    return waited(use) ? Duration::zero() : std::max(Duration::zero(), now - woke_ - (use.cpu - before_.cpu));
  }

  Duration kept_{};  ///< from the step under way
  Duration woken_late_{};
  TimePoint woke_{};
  bool slept_ = false;
  ThreadUse before_;  ///< at the end of the step before
};

/// Missed deadlines by who missed them.
struct Misses {
  std::uint64_t by_os = 0;
  std::uint64_t by_run = 0;
  std::uint64_t waiting = 0;  ///< of ours: the step slept or waited for a lock

  void add(Miss miss) noexcept {
    by_os += miss == Miss::os;
    by_run += miss == Miss::computing || miss == Miss::waiting;
    waiting += miss == Miss::waiting;
  }
  /// Periods left out, `by_os` of them.
  void skip(int all, int of_os) noexcept {
    const int machines = std::clamp(of_os, 0, all);
    by_os += static_cast<std::uint64_t>(machines);
    by_run += static_cast<std::uint64_t>(all - machines);
  }
  [[nodiscard]] std::uint64_t all() const noexcept { return by_os + by_run; }
};

}  // namespace subworld
