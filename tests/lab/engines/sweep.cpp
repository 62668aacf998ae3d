#include "lab/engines/sweep.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <iterator>

namespace subworld {

namespace {

constexpr double kMostSteps = 1e7;  ///< of a run; a larger number is a typing error

std::vector<Combination> swept_combinations(const EngineSweep& sweep, SceneKind kind) {
  const Combination first = kTable1[0];
  std::vector<Combination> all;
  if (sweep.frictions.empty() && sweep.restitutions.empty() && sweep.steps_s.empty()) {
    if (sweep.quick) return {kTable1[0], kTable1[2]};
    all.assign(std::begin(kTable1), std::end(kTable1));
    if (kind != SceneKind::structure) return all;
    for (const double dt_s : kFinerSteps_s) all.push_back({first.friction, first.restitution, dt_s});
    return all;
  }
  const auto asked_or = [](const std::vector<double>& asked, double usual) {
    return asked.empty() ? std::vector<double>{usual} : asked;
  };
  for (const double friction : asked_or(sweep.frictions, first.friction)) {
    for (const double restitution : asked_or(sweep.restitutions, first.restitution)) {
      for (const double dt_s : asked_or(sweep.steps_s, first.dt_s)) all.push_back({friction, restitution, dt_s});
    }
  }
  return all;
}

}  // namespace

std::vector<std::string> presets_of(const EngineSweep& sweep, const std::string& engine, SceneKind kind) {
  std::vector<std::string> presets = presets_of(sweep.presets, engine);
  if (sweep.presets.empty() && kind == SceneKind::fall) presets.resize(1);
  return presets;
}

std::vector<EnginePoint> points_of(const EngineSweep& sweep, const std::deque<LabScene>& scenes) {
  std::vector<EnginePoint> points;
  for (const LabScene& scene : scenes) {
    for (const Combination& c : swept_combinations(sweep, scene.kind)) {
      if (sweep.duration_s / c.dt_s > kMostSteps) {
        throw Error(ExitCode::usage, fmt::format("{:g} s in steps of {:g} s are more than {:g} steps; take a shorter "
                                                 "--duration or a longer --dt",
                                                 sweep.duration_s, c.dt_s, kMostSteps));
      }
      for (const std::string& engine : sweep.engines) {
        for (const std::string& preset : presets_of(sweep, engine, scene.kind))
          points.push_back({&scene, engine, preset, c.friction, c.restitution, c.dt_s, sweep.duration_s});
      }
    }
  }
  return points;
}

std::string combination_text(const Json& row) {
  return fmt::format("friction {:g}, restitution {:g}, dt {}", number(row, "friction"), number(row, "restitution"),
                     step_text(number(row, "dt_s")));
}

}  // namespace subworld
