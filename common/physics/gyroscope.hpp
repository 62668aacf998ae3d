#pragma once

#include "model/types.hpp"

namespace subworld {

/// Whether a body of these principal moments (kg m^2) feels the gyroscopic torque: not cubes and spheres.
[[nodiscard]] bool feels_gyroscopic_torque(const Vec3& inertia) noexcept;

/// What the gyroscopic torque makes of an angular velocity (world frame, rad/s) within dt, for an engine to be set to
/// before it steps: engines have the term explicit (gains energy), implicit (loses it) or not at all. Solves Euler's
/// equations in the body frame by the implicit midpoint rule, which keeps the energy and the size of the angular
/// momentum.
[[nodiscard]] Vec3 turned_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity,
                                 double dt) noexcept;

/// What an angular impulse (N m s, world frame) adds to the angular velocity of a body (rad/s).
[[nodiscard]] Vec3 spun_up(const Quat& orientation, const Vec3& inertia, const Vec3& angular_impulse) noexcept;

}  // namespace subworld
