#include "rt/calibration.hpp"

#include "rt/cyclic.hpp"

#include <sys/mman.h>

#include <thread>
#include <vector>

namespace subworld {

Calibration calibrate(int loops, double period_s, double duration_s) {
  std::vector<Calibration> parts(static_cast<std::size_t>(loops));
  std::vector<std::thread> threads;
  for (Calibration& part : parts) {
    threads.emplace_back([&part, period_s, duration_s] {
      part.granted = claim_realtime(priority::kHaptic);
      const TimePoint end = Clock::now() + from_seconds(duration_s);
      Cyclic loop(Clock::now(), from_seconds(period_s));
      do {
        part.lateness.add(to_seconds(loop.wait()));
        loop.skip(Clock::now());
      } while (loop.released() < end);
    });
  }
  Calibration all;
  all.period_s = period_s;
  all.loops = loops;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    threads[i].join();
    all.lateness.add(parts[i].lateness);
    all.granted = parts[i].granted;
  }
  munlockall();
  return all;
}

}  // namespace subworld
