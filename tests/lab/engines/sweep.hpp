#pragma once

#include "lab/engines/run.hpp"
#include "lab/page/engine_choice.hpp"

#include <deque>
#include <string>
#include <vector>

namespace subworld {

/// A row of the paper's Table 1.
struct Combination {
  double friction;
  double restitution;
  double dt_s;
};
/// Its five rows, in the same order.
inline constexpr Combination kTable1[] = {{0.5, 0.4, 1.0 / 60.0},
                                          {0.5, 0.0, 1.0 / 60.0},
                                          {0.5, 0.4, 1.0 / 100.0},
                                          {1.0, 0.4, 1.0 / 60.0},
                                          {0.0, 0.4, 1.0 / 60.0}};
/// Further time steps of structures, with the friction and restitution of the first row: error against run time.
inline constexpr double kFinerSteps_s[] = {1.0 / 250.0, 1.0 / 500.0, 1.0 / 1000.0};

/// Requested runs. An empty list means the paper's procedure.
struct EngineSweep {
  std::vector<std::string> scenes;  ///< files
  std::vector<std::string> engines;
  std::vector<std::string> presets;
  std::vector<double> frictions;
  std::vector<double> restitutions;
  std::vector<double> steps_s;
  double duration_s = 10.0;
  bool quick = false;
};

/// The requested presets; by default every preset for a structure and the first for a fall. Throws `Error` (usage) if
/// the engine or a preset does not exist.
[[nodiscard]] std::vector<std::string> presets_of(const EngineSweep& sweep, const std::string& engine, SceneKind kind);
/// Every run, scene by scene. Throws `Error` (usage).
[[nodiscard]] std::vector<EnginePoint> points_of(const EngineSweep& sweep, const std::deque<LabScene>& scenes);
/// "friction 0.5, restitution 0.4, dt 1/60"
[[nodiscard]] std::string combination_text(const Json& row);

}  // namespace subworld
