#pragma once

#include "model/joint.hpp"

#include <btBulletDynamicsCommon.h>

#include <array>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace subworld::bullet {

/// A joint in Bullet's world, so that its bodies are in one island and need not collide. Its rows are those of
/// JointRows; for Bullet's own solvers it has none.
class JointConstraint final : public btTypedConstraint {
 public:
  JointConstraint(const Joint& of, btRigidBody& a, btRigidBody& b)
      : btTypedConstraint(D6_CONSTRAINT_TYPE, a, b), joint(of) {}

  void getInfo1(btConstraintInfo1* info) override { info->m_numConstraintRows = info->nub = 0; }
  void getInfo2(btConstraintInfo2* /*info*/) override {}
  void setParam(int /*number*/, btScalar /*value*/, int /*axis*/) override {}
  btScalar getParam(int /*number*/, int /*axis*/) const override { return 0; }

  Joint joint;
  std::array<double, 18> last_n{};  ///< forces of the bounded rows in the last step, N or N m
  JointLoad load;                   ///< since it was taken last
};

/// The joints that act in a world, by index.
class JointSet {
 public:
  explicit JointSet(btDynamicsWorld& world) : world_(world) {}
  ~JointSet() {
    for (std::size_t i = 0; i < joints_.size(); ++i) remove(i);
  }
  JointSet(const JointSet&) = delete;
  JointSet& operator=(const JointSet&) = delete;

  void add(std::size_t i, const Joint& joint, btRigidBody& a, btRigidBody& b);
  void remove(std::size_t i);
  /// What the joint did since the last call.
  [[nodiscard]] JointLoad take_load(std::size_t i) { return std::exchange(joints_[i]->load, {}); }

 private:
  btDynamicsWorld& world_;
  std::vector<std::unique_ptr<JointConstraint>> joints_;
};

}  // namespace subworld::bullet
