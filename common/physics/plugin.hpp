#pragma once

#include "physics/engine.hpp"

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

namespace subworld {

/// What a sub-step costs on one core of the machine on which it was measured (README: published coefficients).
struct SubstepCost {
  double step_s = 0.0;
  double body_s = 0.0;               ///< for each movable body
  double contact_s = 0.0;            ///< for each contact point
  double contact_iteration_s = 0.0;  ///< for each contact point and iteration of the solver
};

/// The mass of a cube over that of a cube on which it rests, at which the lower one gives way (`subworld lab
/// stability`, case heavy_carried).
struct HeavyOnLight {
  double at_1_ms = std::numeric_limits<double>::infinity();
  double at_4_ms = std::numeric_limits<double>::infinity();
};

/// A named choice of an engine's own settings.
struct EnginePreset {
  std::string_view name;
  std::string_view what;  ///< what it sets and why, one line
  int iterations = 0;     ///< where the settings name none; at least so many
  double longest_substep_s = std::numeric_limits<double>::infinity();
  double longest_iteration_s = std::numeric_limits<double>::infinity();  ///< where each is a time step of its own
  SubstepCost cost = {};
  HeavyOnLight heavy_on_light = {};
};

/// What an engine does not hold; each as measured by `subworld lab stability`, or set by the engine itself.
struct EngineLimits {
  double smallest_box = 0.0;  ///< sides of boxes below it, in units of length, are not held
  double plane_half_side_m = std::numeric_limits<double>::infinity();  ///< a plane ends so far from its position
  double speed_m_s = std::numeric_limits<double>::infinity();          ///< nothing moves faster
  double spin_rad_s = std::numeric_limits<double>::infinity();         ///< nothing turns faster
  int iterations = std::numeric_limits<int>::max();  ///< the solver makes no more; 0: as many as it chooses itself
  bool continuous = false;  ///< what moves through a thin body within one step is held nevertheless
};

/// What an engine's library tells of itself and how it is made.
struct EnginePlugin {
  std::string_view name;     ///< as in scenes and on the command line
  std::string_view version;  ///< of the engine and its precision
  std::string_view licence;  ///< of the engine
  std::span<const EnginePreset> presets;
  EngineLimits limits = {};
  std::unique_ptr<Engine> (*make)(const EngineSettings& settings, std::span<const Mesh> meshes);
};

/// The preset that the settings name, as an index into `presets`. Throws `Error` (usage) that names those there are.
[[nodiscard]] std::size_t find_preset(const EnginePlugin& plugin, std::string_view name);

/// Interpolated in the logarithms of step and mass ratio; beyond 1 and 4 ms likewise.
[[nodiscard]] double heaviest_on_light(const HeavyOnLight& ratio, double dt) noexcept;

/// In how many sub-steps an engine divides a step of `dt` (s): as many as the settings say, or else so many that none
/// is longer than `longest_s`.
[[nodiscard]] int substep_count(double dt, std::optional<int> fixed, double longest_s) noexcept;
/// How many iterations an engine makes in a sub-step of `h` (s): as many as the settings say, or else at least `least`
/// and so many that none is longer than `longest_s`.
[[nodiscard]] int iteration_count(double h, std::optional<int> fixed, int least, double longest_s) noexcept;

/// Changes whenever a type that crosses between a program and an engine's library changes.
inline constexpr int kEnginePluginInterface = 8;

}  // namespace subworld

/// Exports the engine of a library; once in each. The interface number and the compiler stand in the symbol's answer,
/// so that a library of another build is refused and not called.
#define SUBWORLD_ENGINE_PLUGIN(plugin)                                                                         \
  extern "C" __attribute__((visibility("default"))) const ::subworld::EnginePlugin* subworld_engine_plugin() { \
    return &(plugin);                                                                                          \
  }                                                                                                            \
  extern "C" __attribute__((visibility("default"))) int subworld_engine_plugin_interface() {                   \
    return ::subworld::kEnginePluginInterface;                                                                 \
  }                                                                                                            \
  extern "C" __attribute__((visibility("default"))) const char* subworld_engine_plugin_compiler() {            \
    return __VERSION__;                                                                                        \
  }
