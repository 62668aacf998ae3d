#pragma once

#include "io/results/json.hpp"
#include "lab/engines/judge.hpp"
#include "lab/page/tables.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// A scene without its users, and the kind by which engines are judged.
struct LabScene {
  Scene scene;
  SceneKind kind = SceneKind::structure;
};
/// Throws `Error` (usage).
[[nodiscard]] LabScene load_lab_scene(const std::string& file);

/// One run of one engine.
struct EnginePoint {
  const LabScene* scene = nullptr;
  std::string engine;
  std::string preset;
  double friction = 0.5;  ///< of each pair, like restitution
  double restitution = 0.4;
  double dt_s = 1.0 / 60.0;
  double duration_s = 10.0;

  [[nodiscard]] int steps() const;
  [[nodiscard]] std::string file_name() const;  ///< without its extension
};

/// The same, from the row of the run.
[[nodiscard]] std::string file_name_of(const Json& row);

/// Times of one step, s.
struct StepTime {
  double wall_s = 0.0;
  double cpu_s = 0.0;  ///< of the thread
};
/// Time of engine.step() only.
[[nodiscard]] StepTime timed_step(Engine& engine, double dt_s);

struct EngineRun {
  Json row;
  Rows history;  ///< at most kMostHistoryRows
};
inline constexpr int kMostHistoryRows = 2000;
inline constexpr int kMostStateFrames = 200;

/// Empty if a signal requested a stop. An engine that fails gives a row with the reason. `states`: a file for the
/// states of all bodies over time, or empty. `progress` is called with the simulated time.
[[nodiscard]] std::optional<EngineRun> run_engine(const EnginePoint& point, const std::string& states,
                                                  const std::function<void(double)>& progress);

}  // namespace subworld
