#pragma once

#include "model/types.hpp"

namespace subworld {

/// Whether a body with these principal moments (kg m^2) has a gyroscopic torque: cubes and spheres have not.
[[nodiscard]] bool feels_gyroscopic_torque(const Vec3& inertia) noexcept;

/// Angular velocity (world frame, rad/s) after the gyroscopic torque has acted for dt (s). An engine is set to it
/// before its step, because engines have the term explicit (gains energy), implicit (loses energy) or not at all.
/// Solves Euler's equations in the body frame by the implicit midpoint rule, which conserves the energy and the size of
/// the angular momentum.
[[nodiscard]] Vec3 turned_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity,
                                 double dt) noexcept;

/// Change of a body's angular velocity (rad/s) by an angular impulse (N m s, world frame).
[[nodiscard]] Vec3 spun_up(const Quat& orientation, const Vec3& inertia, const Vec3& angular_impulse) noexcept;

}  // namespace subworld
