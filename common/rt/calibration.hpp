#pragma once

#include "rt/histogram.hpp"
#include "rt/scheduling.hpp"

namespace subworld {

/// Wake-up lateness of loops that do no work.
struct Calibration {
  double period_s = 0.0;
  int loops = 0;       ///< number of simultaneous loops
  Histogram lateness;  ///< of the wake-ups
  Scheduling granted;  ///< scheduling that the loops of a run will have
};

/// Runs `loops` empty loops of `period_s` at haptic priority for `duration_s`, each in its own thread. Memory is locked
/// only during the call.
[[nodiscard]] Calibration calibrate(int loops, double period_s, double duration_s);

}  // namespace subworld
