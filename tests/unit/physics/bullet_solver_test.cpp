#include "common/physics/bullet/small_steps.hpp"
#include "common/physics/bullet/solver/bounce_limit.hpp"
#include "common/physics/bullet/solver/contact_solver.hpp"

#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace subworld::bullet {
namespace {

constexpr int kBoxes = 30;

/// Boxes that fall onto each other and a fixed ball, between fixed walls.
struct World {
  explicit World(btConstraintSolver& solver, btScalar friction = 0)
      : rough(friction), dispatcher(&configuration), world(&dispatcher, &broadphase, &solver, &configuration) {
    auto& info = world.getSolverInfo();
    info.m_solverMode = SOLVER_USE_WARMSTARTING | SOLVER_USE_2_FRICTION_DIRECTIONS;
    info.m_warmstartingFactor = 1;
    info.m_splitImpulse = 1;
    info.m_splitImpulsePenetrationThreshold = 0;
    world.setGravity({0, 0, -9.81});
    add(floor, 0, {0, 0, 0});
    add(ball, 0, {0.1, 0.05, 0});
    for (const btScalar sign : {-1.0, 1.0}) {
      add(wall, 0, {sign * 1.4, 0, 0});
      add(wall, 0, {0, sign * 1.4, 0});
    }
    for (int i = 0; i < kBoxes; ++i) {
      const btScalar layer = i / 4;
      add(box, 0.2 + 0.01 * i, {0.2 * (i % 2) + 0.01 * layer, 0.2 * (i / 2 % 2), 0.5 + 0.2 * layer});
    }
  }
  ~World() {
    for (const auto& body : bodies) world.removeRigidBody(body.get());
  }

  void add(btCollisionShape& shape, btScalar mass, const btVector3& place) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape.calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, &shape, inertia);
    info.m_startWorldTransform.setOrigin(place);
    info.m_friction = info.m_restitution = rough;
    bodies.push_back(std::make_unique<btRigidBody>(info));
    bodies.back()->setActivationState(DISABLE_DEACTIVATION);
    bodies.back()->setFlags(0);
    world.addRigidBody(bodies.back().get());
  }

  btScalar rough;  ///< friction and restitution
  btStaticPlaneShape floor{{0, 0, 1}, 0};
  btSphereShape ball{0.3};
  btBoxShape wall{{1, 1, 1}}, box{{0.08, 0.08, 0.08}};
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher;
  btDbvtBroadphase broadphase;
  btDiscreteDynamicsWorld world;
  std::vector<std::unique_ptr<btRigidBody>> bodies;
};

/// Steps two worlds that have different solvers and are `rough` alike, until their states differ; returns the number of
/// equal steps.
int equal_steps(btConstraintSolver& one, btConstraintSolver& other, btScalar rough, int steps) {
  World reference(one, rough), world(other, rough);
  for (int step = 0; step < steps; ++step) {
    reference.world.stepSimulation(0.004, 0);
    world.world.stepSimulation(0.004, 0);
    for (std::size_t i = 0; i < world.bodies.size(); ++i) {
      const btRigidBody &a = *reference.bodies[i], &b = *world.bodies[i];
      if (!(a.getWorldTransform() == b.getWorldTransform()) || a.getLinearVelocity() != b.getLinearVelocity() ||
          a.getAngularVelocity() != b.getAngularVelocity()) {
        return step;
      }
    }
  }
  EXPECT_GT(world.dispatcher.getNumManifolds(), kBoxes / 2) << "too few contacts to prove anything";
  return steps;
}

/// A body that leaves with 1.25 times its speed, times the factor of its restitution: it has its initial energy at 0.8.
TEST(BounceLimit, FindsTheFactorThatConservesTheEnergy) {
  btBoxShape shape({0.1, 0.1, 0.1});
  btRigidBody body(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape, {1, 1, 1}));
  std::vector<Mover> movers(2);
  movers[1].body = &body;
  movers[1].inverse_mass = 1;
  movers[1].immovable = false;
  std::vector<Motion> before(2), after(2);
  before[1].linear[2] = -1;
  BounceLimit limit;
  limit.begin(movers);
  limit.join(kFixed, 1, true);
  int tries = 0;
  do {
    after[1].linear[2] = 1.25 * limit.factor(kFixed, 1);
  } while (limit.lower(before, after, false) && ++tries < BounceLimit::kMostTries);
  EXPECT_LT(tries, BounceLimit::kMostTries);
  EXPECT_LE(limit.factor(kFixed, 1), 0.8 + 1e-5);
  EXPECT_GT(limit.factor(kFixed, 1), 0.7);
}

TEST(BounceLimit, DoesNotChangeBouncesWithoutGain) {
  std::vector<Mover> movers(2);
  BounceLimit limit;
  limit.begin(movers);
  limit.join(1, kFixed, true);
  EXPECT_FALSE(limit.lower(std::vector<Motion>(2), std::vector<Motion>(2), false));
  EXPECT_EQ(limit.factor(1, kFixed), 1);
}

TEST(BulletSolver, WithoutFrictionMovesBodiesAsBulletsOwnBitByBit) {
  btSequentialImpulseConstraintSolver bullets;
  ContactSolver ours;
  EXPECT_EQ(equal_steps(bullets, ours, 0, 500), 500);
}

// Hosts of one run may have different processors.
TEST(SmallSteps, AreEqualBitByBitWithoutLongVectors) {
  if (!ContactBatches::has_long_vectors()) GTEST_SKIP() << "this processor has no long vectors";
  Workers alone(1);
  SmallStepSolver with(alone, true), without(alone, false);
  EXPECT_EQ(equal_steps(with, without, btScalar(0.6), 500), 500);
}

}  // namespace
}  // namespace subworld::bullet
