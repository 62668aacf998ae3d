#pragma once

#include "io/results.hpp"
#include "rt/kernel_share.hpp"
#include "rt/lateness.hpp"
#include "rt/scheduling.hpp"

namespace subworld {

/// The times of one step of a loop. In lock-step nobody waits for a clock, and all but the first are zero.
struct StepTimes {
  double step_s = 0.0;
  double lateness_s = 0.0;    ///< with which it began
  double woken_late_s = 0.0;  ///< of that, the machine's: of the wake-up alone
  Miss miss = Miss::none;
};

/// What a real-time loop was granted, and what the kernel gave to its thread and kept from it meanwhile.
class MachineShare {
 public:
  void begin(const Scheduling& granted) {
    granted_ = granted;
    begin_ = kernel_share();
  }
  void end() { share_ = kernel_share().since(begin_); }
  [[nodiscard]] Json json() const;

 private:
  Scheduling granted_;
  KernelShare begin_, share_;
};

}  // namespace subworld
