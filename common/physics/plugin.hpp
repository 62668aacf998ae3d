#pragma once

#include "physics/engine.hpp"

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

namespace subworld {

/// Cost of a sub-step on one core of the machine on which it was measured (README: published coefficients).
struct SubstepCost {
  double step_s = 0.0;
  double body_s = 0.0;               ///< for each movable body
  double contact_s = 0.0;            ///< for each contact point
  double contact_iteration_s = 0.0;  ///< for each contact point and iteration of the solver
};

/// Mass ratio of a cube and the cube below it at which the lower one fails to support it (`subworld lab stability`,
/// case heavy_carried).
struct HeavyOnLight {
  double at_1_ms = std::numeric_limits<double>::infinity();
  double at_4_ms = std::numeric_limits<double>::infinity();
};

/// A named set of an engine's own settings.
struct EnginePreset {
  std::string_view name;
  std::string_view what;  ///< the settings and their purpose, one line
  int iterations = 0;     ///< if the settings give none; a lower bound
  double longest_substep_s = std::numeric_limits<double>::infinity();
  /// If each iteration is a time step of its own.
  double longest_iteration_s = std::numeric_limits<double>::infinity();
  SubstepCost cost = {};
  double parallel_ratio = 0.0;  ///< share of that time which threads divide among them
  HeavyOnLight heavy_on_light = {};
};

/// Limits of an engine, measured by `subworld lab stability` or set by the engine itself.
struct EngineLimits {
  double smallest_box = 0.0;  ///< smaller sides of boxes, in units of length, are not supported
  /// A plane ends at this distance from its position.
  double plane_half_side_m = std::numeric_limits<double>::infinity();
  double speed_m_s = std::numeric_limits<double>::infinity();   ///< largest speed of any body
  double spin_rad_s = std::numeric_limits<double>::infinity();  ///< largest angular speed of any body
  /// Upper bound of the solver's iterations; 0: the engine chooses the number.
  int iterations = std::numeric_limits<int>::max();
  bool continuous = false;  ///< a body that would pass through a thin body within one step is stopped
};

/// Description of an engine in its library, and the functions that make it.
struct EnginePlugin {
  std::string_view name;     ///< as in scenes and on the command line
  std::string_view version;  ///< of the engine and its precision
  std::string_view licence;  ///< of the engine
  std::span<const EnginePreset> presets;
  EngineLimits limits = {};
  std::unique_ptr<Engine> (*make)(const EngineSettings& settings, std::span<const Mesh> meshes);
};

/// The preset that the settings name, as an index into `presets`. Throws `Error` (usage) with the available names.
[[nodiscard]] std::size_t find_preset(const EnginePlugin& plugin, std::string_view name);

/// Interpolated in the logarithms of step and mass ratio, and extrapolated beyond 1 and 4 ms.
[[nodiscard]] double heaviest_on_light(const HeavyOnLight& ratio, double dt) noexcept;

/// Number of sub-steps for a step of `dt` (s): that of the settings, or else the least for which none is longer than
/// `longest_s`.
[[nodiscard]] int substep_count(double dt, std::optional<int> fixed, double longest_s) noexcept;
/// Number of iterations in a sub-step of `h` (s): that of the settings, or else at least `least`, and enough that none
/// is longer than `longest_s`.
[[nodiscard]] int iteration_count(double h, std::optional<int> fixed, int least, double longest_s) noexcept;

/// Changes whenever a type changes that a program and an engine's library share.
inline constexpr int kEnginePluginInterface = 9;

}  // namespace subworld

/// Exports the engine of a library; use once in each. The result contains the interface number and the compiler, so
/// that a library of another build is refused and not called.
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
