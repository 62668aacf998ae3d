#include "lab/engine_sweep.hpp"

#include "model/error.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace subworld {

namespace {

constexpr double kShortestStep_s = 1e-5;
constexpr double kLongestStep_s = 0.1;
constexpr double kMostSteps = 1e7;  ///< of a run; more is a slip of the pen
constexpr std::array kDisplayOrder{"havok", "physx", "bullet"};

std::vector<Combination> combinations_of(const EngineSweep& sweep, SceneKind kind) {
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

std::vector<std::string> in_display_order(std::vector<std::string> engines) {
  const auto rank = [](const std::string& name) {
    const auto known = std::ranges::find(kDisplayOrder, name);
    return std::pair(known - kDisplayOrder.begin(), name);
  };
  std::ranges::sort(engines, {}, rank);
  return engines;
}

std::vector<std::string> presets_of(const EngineSweep& sweep, const std::string& engine, SceneKind kind) {
  const EnginePlugin& plugin = engine_plugin(engine);
  for (const std::string& preset : sweep.presets) (void)find_preset(plugin, preset);
  if (!sweep.presets.empty()) return sweep.presets;
  std::vector<std::string> presets;
  for (const EnginePreset& preset : plugin.presets) presets.emplace_back(preset.name);
  if (kind == SceneKind::fall) presets.resize(1);
  return presets;
}

std::vector<EnginePoint> points_of(const EngineSweep& sweep, const std::deque<LabScene>& scenes) {
  std::vector<EnginePoint> points;
  for (const LabScene& scene : scenes) {
    for (const Combination& c : combinations_of(sweep, scene.kind)) {
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

double step_of(const std::string& text) {
  char* end = nullptr;
  double value = std::strtod(text.c_str(), &end);
  if (*end == '/') {
    const char* parts = end + 1;
    value /= std::strtod(parts, &end);
    if (end == parts) end = const_cast<char*>(text.c_str());
  }
  if (end == text.c_str() || *end != '\0' || !(value >= kShortestStep_s && value <= kLongestStep_s)) {
    throw Error(ExitCode::usage, fmt::format("--dt {}: not a time step; write seconds from {:g} to {:g}, as in 1/60 or "
                                             "0.01",
                                             text, kShortestStep_s, kLongestStep_s));
  }
  return value;
}

std::string combination_text(const Json& row) {
  return fmt::format("friction {:g}, restitution {:g}, dt {}", number(row, "friction"), number(row, "restitution"),
                     step_text(number(row, "dt_s")));
}

}  // namespace subworld
