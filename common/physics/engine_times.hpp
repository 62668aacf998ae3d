#pragma once

#include <ctime>

namespace subworld {

/// CPU times of an engine's steps, s.
struct EngineTimes {
  double solving_s = 0.0;   ///< in the library's or module's step
  double exchange_s = 0.0;  ///< transfer of states, loads and contacts
  double totals_s = 0.0;    ///< adding up and ordering contacts
  double friction_s = 0.0;  ///< friction estimate, for engines that do not report friction
};

/// Adds the time between two calls to a member of an `EngineTimes`. Without one it does not read the clock.
class EngineClock {
 public:
  void follow(EngineTimes* times) noexcept { times_ = times; }
  void start() noexcept {
    if (times_) last_s_ = now_s();
  }
  void ends(double EngineTimes::*part) noexcept {
    if (!times_) return;
    const double now = now_s();
    times_->*part += now - last_s_;
    last_s_ = now;
  }

 private:
  static double now_s() noexcept {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }

  EngineTimes* times_ = nullptr;
  double last_s_ = 0.0;
};

}  // namespace subworld
