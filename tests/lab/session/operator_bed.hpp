#pragma once

#include "coupling/tool/stiffness.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/setting.hpp"
#include "model/scene/scene.hpp"

#include <functional>
#include <string>

namespace subworld {

/// A scene of deploy/scenes with its first user only, whose device an operator holds.
[[nodiscard]] Scene scene_with_operator(const std::string& name, DeviceKind kind);
/// `press` with the operator's tool in free space.
[[nodiscard]] Scene free_scene(DeviceKind kind);

/// Link with delayed messages.
enum class Side : std::uint8_t { device, world };
/// Sets the round-trip delay, the largest jitter and the share of lost messages.
void lengthen(Scene& scene, Side side, double delay_s, double jitter_s = 0.02, double loss_ratio = 0.05);

/// Properties of a device that the wall's formula does not contain.
struct Sensor {
  double friction_n = 0.0;
  double resolution_m = 0.0;
};
/// A device in a wall of this stiffness: its proxy is fixed. An operator with half the mass and damping, and without
/// stiffness, pushes it once at 0.2 s.
[[nodiscard]] Scene wall_scene(const SampledWall& wall, double stiffness_n_m, const Sensor& sensor = {});

/// The same scene with this engine for world and sub-world, with its preset's iterations.
[[nodiscard]] Scene in_engine(Scene scene, const EngineSetting& setting);

/// Runs cycles until the world's time is `until_s`, while `goes_on` returns true. Throws `Interrupted`, or
/// `std::runtime_error` if a value is no longer finite.
void run_while(CoupledRun& run, double until_s, const std::function<bool()>& goes_on);

}  // namespace subworld
