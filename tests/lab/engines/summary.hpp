#pragma once

#include "lab/engines/report.hpp"
#include "lab/engines/sweep.hpp"

#include <deque>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// The planned measurements: the runs of the scenes, then figure 12.
struct EnginePlan {
  std::deque<LabScene> scenes;
  std::vector<EnginePoint> points;
  std::vector<std::pair<std::string, std::string>> costs;  ///< engine and preset
};

/// Settings, machine and engines of the runs, with grades, fits and advice.
[[nodiscard]] Json engine_summary(const EnginePlan& plan, const EngineSweep& sweep, const EngineFindings& found);

}  // namespace subworld
