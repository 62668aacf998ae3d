#pragma once

#include "rt/histogram.hpp"
#include "rt/scheduling.hpp"

namespace subworld {

/// How late the machine wakes loops that do nothing.
struct Calibration {
  double period_s = 0.0;
  int loops = 0;       ///< at once
  Histogram lateness;  ///< of their wake-ups
  Scheduling granted;  ///< as the loops of a run will have it
};

/// Runs `loops` bare loops of `period_s` at haptic priority for `duration_s`, each in a thread of its own. Memory is
/// locked only meanwhile.
[[nodiscard]] Calibration calibrate(int loops, double period_s, double duration_s);

}  // namespace subworld
