#pragma once

#include "physics/bullet/solver/contact_rows.hpp"
#include "physics/bullet/surface.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

// Initial capacities, larger than usual scenes need, so that steps allocate nothing.
inline constexpr std::size_t kUsualBodies = 1024, kUsualPairs = 4096, kUsualPoints = 4096;

/// A body in the solvers' format.
struct Mover {
  btRigidBody* body = nullptr;  ///< null: fixed
  btScalar inverse_mass = 0;    ///< 1/kg
  bool immovable = true;
  btVector3 by_force{0, 0, 0};   ///< change of the linear velocity by forces in a step, m/s
  btVector3 by_torque{0, 0, 0};  ///< rad/s
  btMatrix3x3 inverse_inertia{0, 0, 0, 0, 0, 0, 0, 0, 0};
};
inline constexpr std::size_t kFixed = 0;  ///< index of the mover that represents all fixed bodies

/// The mover of a movable body for a step of `dt` (s).
[[nodiscard]] Mover make_mover(btRigidBody& body, btScalar dt);
/// Lists the movable bodies for a step of `dt` (s), and stores its index in each body.
void list_movers(std::span<btCollisionObject* const> bodies, btScalar dt, std::vector<Mover>& movers);
/// The stored index.
[[nodiscard]] std::size_t mover_of(const btCollisionObject& body);

/// Velocities of a mover, and their changes by forces and torques in a step.
[[nodiscard]] Motion motion_of(const Mover& mover);
[[nodiscard]] Motion by_loads(const Mover& mover);

/// All contact points of two bodies in a solver.
struct ContactPair {
  btPersistentManifold* manifold;
  std::uint32_t a, b;        ///< indices of the movers
  std::uint32_t begin, end;  ///< of the solver's points
  Both inverse_mass;
  btScalar friction;          ///< mu, as given
  bool rubs;                  ///< has friction rows
  std::int32_t turning = -1;  ///< of TurningFriction; -1: none
};
/// The manifold has points. `first_point`: index of the pair's first point; `all_rub`: contacts without friction have
/// friction rows too.
[[nodiscard]] inline ContactPair make_pair_of(btPersistentManifold& manifold, std::span<const Mover> movers,
                                              std::size_t first_point, bool all_rub) {
  const btCollisionObject &first = *manifold.getBody0(), &second = *manifold.getBody1();
  const auto a = static_cast<std::uint32_t>(mover_of(first)), b = static_cast<std::uint32_t>(mover_of(second));
  // The points of a part know its own material.
  const bool has_parts = first.getCollisionShape()->isCompound() || second.getCollisionShape()->isCompound();
  btScalar friction =
      has_parts ? manifold.getContactPoint(0).m_combinedFriction : first.getFriction() * second.getFriction();
  if (const auto own = has_parts ? std::nullopt : own_material(first, second)) {
    friction = static_cast<btScalar>(own->friction);
    for (int i = 0; i < manifold.getNumContacts(); ++i)
      manifold.getContactPoint(i).m_combinedRestitution = static_cast<btScalar>(own->restitution);
  }
  return {.manifold = &manifold,
          .a = a,
          .b = b,
          .begin = static_cast<std::uint32_t>(first_point),
          .end = static_cast<std::uint32_t>(first_point),
          .inverse_mass = Both{movers[a].inverse_mass, movers[b].inverse_mass},
          .friction = friction,
          .rubs = friction > 0 || all_rub};
}

[[nodiscard]] inline BothInertia inertia_of(const Mover& a, const Mover& b) {
  return {Both{a.inverse_mass, b.inverse_mass},
          {of_both(a.inverse_inertia[0], b.inverse_inertia[0]), of_both(a.inverse_inertia[1], b.inverse_inertia[1]),
           of_both(a.inverse_inertia[2], b.inverse_inertia[2])}};
}

/// From the bodies' centres to the point, m.
[[nodiscard]] inline Both3 arms_of(const btPersistentManifold& manifold, const btManifoldPoint& point) {
  return of_both(point.getPositionWorldOnA() - manifold.getBody0()->getWorldTransform().getOrigin(),
                 point.getPositionWorldOnB() - manifold.getBody1()->getWorldTransform().getOrigin());
}

inline btVector3 vector(const btScalar (&v)[3]) { return {v[0], v[1], v[2]}; }

}  // namespace subworld::bullet
