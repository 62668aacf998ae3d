#pragma once

#include "contact_rows.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstddef>
#include <span>
#include <vector>

namespace subworld::bullet {

// Room that no usual scene outgrows, so that steps allocate nothing.
inline constexpr std::size_t kUsualBodies = 1024, kUsualPairs = 4096, kUsualPoints = 4096;

/// A body as the solvers see it.
struct Mover {
  btRigidBody* body = nullptr;  ///< none: fixed
  btScalar inverse_mass = 0;    ///< 1/kg
  bool immovable = true;
  btVector3 by_force{0, 0, 0};   ///< what forces add to the velocity in a step, m/s
  btVector3 by_torque{0, 0, 0};  ///< rad/s
  btMatrix3x3 inverse_inertia{0, 0, 0, 0, 0, 0, 0, 0, 0};
};
inline constexpr std::size_t kFixed = 0;  ///< number of the mover that stands for all fixed bodies

/// Lists the bodies that move, for a step of `dt` (s), and leaves its number with each.
void list_movers(std::span<btCollisionObject* const> bodies, btScalar dt, std::vector<Mover>& movers);
/// That number.
[[nodiscard]] std::size_t mover_of(const btCollisionObject& body);

/// Its velocities, and what forces and torques add to them in a step.
[[nodiscard]] Motion motion_of(const Mover& mover);
[[nodiscard]] Motion by_loads(const Mover& mover);

inline btVector3 vector(const btScalar (&v)[3]) { return {v[0], v[1], v[2]}; }

}  // namespace subworld::bullet
