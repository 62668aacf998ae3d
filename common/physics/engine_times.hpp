#pragma once

#include <ctime>

namespace subworld {

/// Where an engine's steps spend CPU time, s.
struct EngineTimes {
  double solving_s = 0.0;   ///< in the engine itself: its library's or its module's step
  double exchange_s = 0.0;  ///< states, loads and contacts to and from it
  double totals_s = 0.0;    ///< contacts added up and ordered
  double friction_s = 0.0;  ///< the estimate, of engines that do not tell friction
};

/// Adds what passes between two calls to a part of somebody's `EngineTimes`. Without one it does not look at the clock.
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
