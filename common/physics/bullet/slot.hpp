#pragma once

#include "physics/adapter.hpp"
#include "physics/bullet/convex.hpp"
#include "physics/bullet/parts.hpp"
#include "physics/bullet/shapes.hpp"
#include "physics/bullet/surface.hpp"
#include "physics/gyroscope.hpp"

#include <btBulletDynamicsCommon.h>

#include <memory>

namespace subworld::bullet {

/// A body of the adapter.
struct Slot : AdapterSlot {
  std::unique_ptr<btRigidBody> body;
  std::unique_ptr<Parts> parts;  ///< of a compound body
  std::unique_ptr<Surface> surface;
  bool gyroscopic = false;
  FreeTurn turn;
};

/// Weight, force and torque, for the next sub-step.
inline void put_loads(Slot& slot) {
  slot.body->applyCentralForce(to_bullet(slot.weight + slot.force));
  if (!slot.torque.isZero(0.0)) slot.body->applyTorque(to_bullet(slot.torque));
}

/// Before and after a sub-step of `dt` (s): adds the gyroscopic change of a body's angular velocity.
inline void begin_turn(Slot& slot, double dt) {
  const Quat orientation = from_bullet(slot.body->getWorldTransform().getRotation());
  const Vec3 spin = from_bullet(slot.body->getAngularVelocity());
  slot.turn = turn_freely(orientation, slot.inertia, spin, dt);
  slot.body->setAngularVelocity(to_bullet(slot.turn.mean));
}
inline void end_turn(Slot& slot) {
  const Quat orientation = from_bullet(slot.body->getWorldTransform().getRotation());
  const Vec3 spin = from_bullet(slot.body->getAngularVelocity());
  slot.body->setAngularVelocity(to_bullet(slot.turn.end(orientation, spin)));
}

inline constexpr double kStraightTurn_rad = 0.15;  ///< a smaller turn in a step is almost straight

/// The turn (rad) in a step of `dt` (s) of a slender body that sweeps around others within it, which its velocities at
/// one moment do not tell; 0: it does not.
inline double sweeping_turn(const Slot& slot, double dt) {
  constexpr double kSlender = 2.0;  // way of the farthest point over the radius inside the shape
  const double turn_rad = dt * slot.body->getAngularVelocity().length();
  if (turn_rad <= kStraightTurn_rad) return 0.0;
  const Convex& shape = convex_of(*slot.body->getCollisionShape());
  return turn_rad * shape.outer_radius > kSlender * shape.inner_radius ? turn_rad : 0.0;
}

}  // namespace subworld::bullet
