#pragma once

#include "lab/page/tables.hpp"
#include "model/scene/scene.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// A scene for a comparison with an optimisation on and off.
struct PlanPoint {
  std::string scene;            ///< name in the row
  std::function<Scene()> load;  ///< throws `Error` (usage)
  std::string item;             ///< as in --disable, or "all"
};

/// One flat row: costs as ratios of on over off, and the difference of the results. The runs alternate, each in its own
/// process, `repeats` times; the least value of each figure counts. Throws `Error` (failed) if a run fails,
/// `Interrupted` if a signal requests a stop.
[[nodiscard]] Json measured_plan_row(const PlanPoint& point, int repeats);

/// Whether neither the felt force nor the place of a body at the end is worse in such a row: the difference is within
/// the reference error, or the error against the reference is larger by no more than the reference error.
[[nodiscard]] bool no_worse(const Json& row);

}  // namespace subworld
