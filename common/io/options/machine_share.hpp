#pragma once

#include "io/results/results.hpp"
#include "rt/kernel_share.hpp"
#include "rt/lateness.hpp"
#include "rt/scheduling.hpp"

namespace subworld {

/// The times of one step of a loop. In lock-step a loop does not wait for a clock, and all but the first are zero.
struct StepTimes {
  double step_s = 0.0;
  double lateness_s = 0.0;    ///< start of the step after its release
  double woken_late_s = 0.0;  ///< share of lateness_s that is the OS's: late wake-up
  Miss miss = Miss::none;
};

/// Scheduling that the OS granted to a real-time loop, and the time that the kernel gave to its thread or withheld.
struct MachineShare : KernelShare {
  std::string scheduling;
  bool fifo = false;
  bool memory_locked = false;

  void begin(const Scheduling& granted) { *this = {kernel_share(), granted.text, granted.fifo, granted.memory_locked}; }
  void end() { KernelShare::operator=(kernel_share().since(*this)); }
};
SUBWORLD_HAS_JSON(MachineShare)

}  // namespace subworld
