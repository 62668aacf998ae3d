#include "physics/bullet/solver/joint_set.hpp"

namespace subworld::bullet {

void JointSet::add(std::size_t i, const Joint& joint, btRigidBody& a, btRigidBody& b) {
  if (joints_.size() <= i) joints_.resize(i + 1);
  joints_[i] = std::make_unique<JointConstraint>(joint, a, b);
  world_.addConstraint(joints_[i].get(), !joint.collide);
}

void JointSet::remove(std::size_t i) {
  if (!joints_[i]) return;
  world_.removeConstraint(joints_[i].get());
  joints_[i].reset();
}

}  // namespace subworld::bullet
