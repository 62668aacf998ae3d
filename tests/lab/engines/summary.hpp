#pragma once

#include "lab/engines/report.hpp"
#include "lab/engines/sweep.hpp"

#include <deque>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// What is measured: the runs of the scenes first, then figure 12.
struct EnginePlan {
  std::deque<LabScene> scenes;
  std::vector<EnginePoint> points;
  std::vector<std::pair<std::string, std::string>> costs;  ///< engine and preset
};

/// What ran, on which machine and with which engines, the grades, fits and advice.
[[nodiscard]] Json engine_summary(const EnginePlan& plan, const EngineSweep& sweep, const EngineFindings& found);

}  // namespace subworld
