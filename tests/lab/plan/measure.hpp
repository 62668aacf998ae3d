#pragma once

#include "lab/page/tables.hpp"
#include "model/scene.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// A scene with an item of its plan left out and kept in.
struct PlanPoint {
  std::string scene;            ///< name, as in the row
  std::function<Scene()> load;  ///< throws `Error` (usage)
  std::string item;             ///< as in --disable, or "all"
};

/// One flat row: what the item costs, as ratios of left out over kept in, and what it changes. Runs take turns, each in
/// a process of its own, `repeats` times, and the least of each figure counts. Throws `Error` (failed) where a run
/// fails, `Interrupted` where a signal asks to stop.
[[nodiscard]] Json measured_plan_row(const PlanPoint& point, int repeats);

}  // namespace subworld
