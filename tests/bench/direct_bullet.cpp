#include "bench/direct_bullet.hpp"

#include "common/physics/bullet/contacts/box_box.hpp"
#include "common/physics/bullet/contacts/box_plane.hpp"
#include "common/physics/bullet/contacts/convex_contacts.hpp"

#include <algorithm>
#include <cmath>

extern btScalar gContactBreakingThreshold;
extern btScalar gDbvtMargin;

namespace subworld::bench {

using bullet::from_bullet;
using bullet::scalar;
using bullet::to_bullet;

// All numbers here are those of the preset `fast` in common/physics/bullet/bullet.cpp.
DirectBullet::DirectBullet(const Vec3& gravity, double dt)
    : dt_(dt),
      shapes_({}),
      configuration_(bullet::collision_settings()),
      dispatcher_(&configuration_),
      world_(&dispatcher_, &broadphase_, &solver_, &configuration_) {
  gContactBreakingThreshold = scalar(0.005);
  bullet::register_box_box(dispatcher_);
  bullet::register_convex_contacts(dispatcher_);
  bullet::register_box_plane(dispatcher_);
  auto& info = world_.getSolverInfo();
  info.m_numIterations = 10;
  solver_.set_friction_relaxation(scalar(1.3));
  solver_.set_friction_forgotten(scalar(3e-3));
  world_.setGravity(to_bullet(gravity));
}

DirectBullet::~DirectBullet() {
  for (const auto& body : bodies_) world_.removeRigidBody(body.get());
}

void DirectBullet::add(const Body& body, const BodyState& state) {
  btRigidBody::btRigidBodyConstructionInfo info(scalar(body.mass), nullptr, shapes_.get(body.shape),
                                                to_bullet(body.inertia));
  info.m_friction = scalar(std::sqrt(body.material.friction));
  info.m_restitution = scalar(body.material.restitution);
  btRigidBody& made = *bodies_.emplace_back(std::make_unique<btRigidBody>(info));
  made.setActivationState(DISABLE_DEACTIVATION);
  set_state(bodies_.size() - 1, state);
  world_.addRigidBody(&made, body.fixed() ? 2 : 1, body.fixed() ? 1 : 3);
  made.setFlags(0);
  if (body.fixed()) return;
  btVector3 lower, upper;
  made.getAabb(lower, upper);
  const btVector3 size = upper - lower;
  tree_margin_ = std::min({tree_margin_, 0.05 * size.x(), 0.05 * size.y(), 0.05 * size.z()});
  gDbvtMargin = scalar(tree_margin_);
}

void DirectBullet::set_state(std::size_t i, const BodyState& state) {
  btRigidBody& body = *bodies_[i];
  const btTransform pose(to_bullet(state.orientation), to_bullet(state.position));
  body.setWorldTransform(pose);
  body.setInterpolationWorldTransform(pose);
  body.setLinearVelocity(to_bullet(state.linear_velocity));
  body.setAngularVelocity(to_bullet(state.angular_velocity));
  body.setInterpolationLinearVelocity(body.getLinearVelocity());
  body.setInterpolationAngularVelocity(body.getAngularVelocity());
  body.updateInertiaTensor();
  if (body.getBroadphaseHandle() != nullptr) world_.updateSingleAabb(&body);
}

BodyState DirectBullet::state(std::size_t i) const {
  const btRigidBody& body = *bodies_[i];
  return {from_bullet(body.getWorldTransform().getOrigin()), from_bullet(body.getWorldTransform().getRotation()),
          from_bullet(body.getLinearVelocity()), from_bullet(body.getAngularVelocity())};
}

}  // namespace subworld::bench
