#pragma once

#include "common/physics/bullet/shapes.hpp"
#include "common/physics/bullet/solver/contact_solver.hpp"
#include "model/body.hpp"

#include <btBulletDynamicsCommon.h>

#include <memory>
#include <vector>

namespace subworld::bench {

/// The preset `fast` of the engine `bullet`, written with Bullet's own API, as in a program for Bullet only. Same
/// solver, iterations and shapes; nothing is read after a step.
class DirectBullet {
 public:
  DirectBullet(const Vec3& gravity, double dt);
  ~DirectBullet();
  DirectBullet(const DirectBullet&) = delete;
  DirectBullet& operator=(const DirectBullet&) = delete;

  void add(const Body& body, const BodyState& state);
  void set_state(std::size_t i, const BodyState& state);
  [[nodiscard]] BodyState state(std::size_t i) const;
  void step() { world_.stepSimulation(bullet::scalar(dt_), 0); }

 private:
  double dt_;
  double tree_margin_ = 0.05;
  bullet::ShapeStore shapes_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  bullet::ContactSolver solver_;
  btDiscreteDynamicsWorld world_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
};

}  // namespace subworld::bench
