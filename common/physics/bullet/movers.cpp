#include "physics/bullet/movers.hpp"

namespace subworld::bullet {

Mover make_mover(btRigidBody& body, btScalar dt) {
  Mover mover;
  mover.body = &body;
  mover.inverse_mass = body.getInvMass();
  mover.immovable = btVector3(mover.inverse_mass, mover.inverse_mass, mover.inverse_mass).fuzzyZero();
  mover.by_force = body.getTotalForce() * body.getInvMass() * dt;
  mover.by_torque = body.getTotalTorque() * body.getInvInertiaTensorWorld() * dt;
  mover.inverse_inertia = body.getInvInertiaTensorWorld();
  return mover;
}

void list_movers(std::span<btCollisionObject* const> bodies, btScalar dt, std::vector<Mover>& movers) {
  movers.assign(kFixed + 1, Mover{});
  for (btCollisionObject* object : bodies) {
    btRigidBody* body = btRigidBody::upcast(object);
    object->setCompanionId(-1);
    if (body == nullptr || body->getInvMass() == 0) continue;
    object->setCompanionId(static_cast<int>(movers.size()));
    movers.push_back(make_mover(*body, dt));
  }
}

std::size_t mover_of(const btCollisionObject& body) {
  return body.getCompanionId() > 0 ? static_cast<std::size_t>(body.getCompanionId()) : kFixed;
}

Motion motion_of(const Mover& mover) {
  const btVector3 &linear = mover.body->getLinearVelocity(), &angular = mover.body->getAngularVelocity();
  return {{linear.x(), linear.y(), linear.z()}, {angular.x(), angular.y(), angular.z()}};
}

Motion by_loads(const Mover& mover) {
  const btVector3 &linear = mover.by_force, &angular = mover.by_torque;
  return {{linear.x(), linear.y(), linear.z()}, {angular.x(), angular.y(), angular.z()}};
}

}  // namespace subworld::bullet
