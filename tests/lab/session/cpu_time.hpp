#pragma once

#include "rt/histogram.hpp"

#include <ctime>

namespace subworld {

/// CPU time of the calling thread, s.
inline double thread_cpu_s() noexcept {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Adds the calling thread's CPU time during its lifetime.
class CpuTimer {
 public:
  explicit CpuTimer(Histogram& into) noexcept : into_(into), begin_(thread_cpu_s()) {}
  ~CpuTimer() { into_.add(thread_cpu_s() - begin_); }
  CpuTimer(const CpuTimer&) = delete;
  CpuTimer& operator=(const CpuTimer&) = delete;

 private:
  Histogram& into_;
  double begin_;
};

}  // namespace subworld
