#pragma once

#include "coupling/stiffness.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/setting.hpp"
#include "model/scene.hpp"

#include <functional>
#include <string>

namespace subworld {

/// One of deploy/scenes with its first user alone, whose device a hand holds.
[[nodiscard]] Scene scene_with_operator(const std::string& name, DeviceKind kind);
/// `press` with the hand in the air.
[[nodiscard]] Scene free_scene(DeviceKind kind);

/// Where messages are late.
enum class Side : std::uint8_t { device, world };
/// `delay_s` for there and back, `jitter_s` more at most, and so many messages lost.
void lengthen(Scene& scene, Side side, double delay_s, double jitter_s = 0.02, double loss_ratio = 0.05);

/// What a device has that the wall's formula has not.
struct Sensor {
  double friction_n = 0.0;
  double resolution_m = 0.0;
};
/// A device in a wall of this stiffness: a proxy that nothing moves. A hand of half the mass and damping, which has no
/// stiffness of its own, jerks it once at 0.2 s.
[[nodiscard]] Scene wall_scene(const SampledWall& wall, double stiffness_n_m, const Sensor& sensor = {});

/// The same with this engine as the world's and the sub-world's, with its preset's own iterations.
[[nodiscard]] Scene in_engine(Scene scene, const Setting& setting);

/// Cycle by cycle up to `until_s` of the world, while `goes_on` after each is true. Throws `Interrupted`;
/// `std::runtime_error` where something is no longer finite.
void run_while(CoupledRun& run, double until_s, const std::function<bool()>& goes_on);

}  // namespace subworld
