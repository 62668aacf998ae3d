#pragma once

#include "model/body.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

namespace subworld {

class Engine;

struct DevicePose {
  Pose pose;                             ///< in scene coordinates
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s in simulated time
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s in simulated time
};

struct ForceLimits {
  double force_n = 0.0;
  double torque_n_m = 0.0;
  bool torques = false;  ///< false: 3 degrees of freedom, no torque at all
};

[[nodiscard]] ForceLimits limits_of(const DeviceSpec& device) noexcept;

/// The virtual coupling (Colgate 1995) at one instant: the wrench on the proxy,
///   F = K (x_device - x_proxy) + B (v_device - v_proxy), torques likewise, saturated at the device's limits.
/// Here and below all is in simulated time; coupling/tool/tool has the settings and the proxy's mass on a slowed clock.
[[nodiscard]] Wrench coupling_wrench(const CouplingSettings& coupling, const ForceLimits& limits,
                                     const BodyState& proxy, const DevicePose& device) noexcept;

/// Shortens force and torque to their limits, direction kept.
[[nodiscard]] Wrench saturated(Wrench wrench, const ForceLimits& limits) noexcept;

/// How an engine makes one linearly implicit step of length dt of the coupling, stable at any dt:
/// inertia m + D with D = dt (B + dt K), velocity scaled by m / (m + D), force K (x_d - x_p) + B v_d.
/// A saturated coupling is a constant force: D = 0.
struct ImplicitStep {
  double mass = 0.0;             ///< kg, of the proxy during the step
  Vec3 inertia = Vec3::Zero();   ///< kg m^2
  BodyState start;               ///< the proxy's state with scaled velocities
  Wrench wrench;                 ///< constant over the step
  bool force_implicit = false;   ///< false: saturated
  bool torque_implicit = false;  ///< false: saturated or no torque at all
};

[[nodiscard]] ImplicitStep implicit_step(const CouplingSettings& coupling, const ForceLimits& limits,
                                         const Body& proxy_body, const BodyState& proxy, const DevicePose& device,
                                         double dt) noexcept;

/// Prepares the engine's next step to be that one.
void hold(Engine& engine, BodyId proxy, const ImplicitStep& step);

/// The mean wrench that the coupling exerted on the proxy over that step, from the proxy's velocity after it; within
/// the limits, also where a contact stopped the proxy in the middle of the step.
[[nodiscard]] Wrench exerted(const CouplingSettings& coupling, const ForceLimits& limits, const ImplicitStep& step,
                             const BodyState& after, double dt) noexcept;

/// Energy in the coupling's springs, J; a spring at its limit stores force times the rest of its stretch.
[[nodiscard]] double coupling_energy(const CouplingSettings& coupling, const ForceLimits& limits,
                                     const BodyState& proxy, const DevicePose& device) noexcept;

}  // namespace subworld
