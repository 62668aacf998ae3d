#pragma once

#include "model/types.hpp"

namespace subworld {

/// Whether a body with these principal moments (kg m^2) has a gyroscopic torque: cubes and spheres have not.
[[nodiscard]] bool feels_gyroscopic_torque(const Vec3& inertia) noexcept;

/// The free rotation of a body for one step, by the midpoint rule on the rotations: it conserves the energy and the
/// vector of the angular momentum (Simo and Wong, "Unconditionally stable algorithms for rigid body dynamics", 1991).
/// An engine is given it around its step, because engines have the gyroscopic torque explicit (gains energy), implicit
/// (loses energy) or not at all.
struct FreeTurn {
  Vec3 mean = Vec3::Zero();   ///< rad/s, world frame: by it the engine turns the body
  Vec3 after = Vec3::Zero();  ///< rad/s, body frame
  bool solved = false;        ///< not where a step turns the body by more than about half a turn

  /// The angular velocity (rad/s, world frame) after the step, where the engine has `spin`. An engine that turns
  /// inexactly changes the direction of the momentum only.
  [[nodiscard]] Vec3 end(const Quat& orientation_after, const Vec3& spin) const noexcept;
};
/// Before a step of `dt` (s); `angular_velocity` in the world frame (rad/s).
[[nodiscard]] FreeTurn turn_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity,
                                   double dt) noexcept;

/// Angular velocity (world frame, rad/s) after the gyroscopic torque has acted for dt (s), for engines in which a
/// change after the step disturbs bodies on a support. They are set to it before the step. Solves Euler's equations in
/// the body frame by the implicit midpoint rule, which conserves the energy and the size of the angular momentum.
[[nodiscard]] Vec3 turned_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity,
                                 double dt) noexcept;

/// Change of a body's angular velocity (rad/s) by an angular impulse (N m s, world frame).
[[nodiscard]] Vec3 spun_up(const Quat& orientation, const Vec3& inertia, const Vec3& angular_impulse) noexcept;

}  // namespace subworld
