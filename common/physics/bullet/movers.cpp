#include "movers.hpp"

namespace subworld::bullet {

void list_movers(std::span<btCollisionObject* const> bodies, btScalar dt, std::vector<Mover>& movers) {
  movers.assign(kFixed + 1, Mover{});
  for (btCollisionObject* object : bodies) {
    btRigidBody* body = btRigidBody::upcast(object);
    object->setCompanionId(-1);
    if (body == nullptr || body->getInvMass() == 0) continue;
    object->setCompanionId(static_cast<int>(movers.size()));
    Mover& mover = movers.emplace_back();
    mover.body = body;
    mover.inverse_mass = body->getInvMass();
    mover.immovable = btVector3(mover.inverse_mass, mover.inverse_mass, mover.inverse_mass).fuzzyZero();
    mover.by_force = body->getTotalForce() * body->getInvMass() * dt;
    mover.by_torque = body->getTotalTorque() * body->getInvInertiaTensorWorld() * dt;
    mover.inverse_inertia = body->getInvInertiaTensorWorld();
  }
}

std::size_t mover_of(const btCollisionObject& body) {
  return body.getCompanionId() > 0 ? static_cast<std::size_t>(body.getCompanionId()) : kFixed;
}

ContactPair make_pair_of(btPersistentManifold& manifold, std::span<const Mover> movers, std::size_t first_point,
                         bool all_rub) {
  const btCollisionObject &first = *manifold.getBody0(), &second = *manifold.getBody1();
  const std::size_t a = mover_of(first), b = mover_of(second);
  const btScalar friction = first.getFriction() * second.getFriction();
  return {.manifold = &manifold,
          .a = a,
          .b = b,
          .begin = first_point,
          .end = first_point,
          .inverse_mass = Both{movers[a].inverse_mass, movers[b].inverse_mass},
          .friction = friction,
          .rubs = friction > 0 || all_rub};
}

BothInertia inertia_of(const Mover& a, const Mover& b) {
  return {Both{a.inverse_mass, b.inverse_mass},
          {of_both(a.inverse_inertia[0], b.inverse_inertia[0]), of_both(a.inverse_inertia[1], b.inverse_inertia[1]),
           of_both(a.inverse_inertia[2], b.inverse_inertia[2])}};
}

Both3 arms_of(const btPersistentManifold& manifold, const btManifoldPoint& point) {
  return of_both(point.getPositionWorldOnA() - manifold.getBody0()->getWorldTransform().getOrigin(),
                 point.getPositionWorldOnB() - manifold.getBody1()->getWorldTransform().getOrigin());
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
