#include "coupling/schemes/reduced/ghost_motion.hpp"
#include "coupling/schemes/reduced/carried.hpp"
#include "coupling/schemes/reduced/ghost_model.hpp"
#include "support/outside.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace subworld {
namespace {

using test::carried;
using test::kCube_kg;

constexpr double kNoLimit_n = 1e9;

GhostMotion sticking(double limit_n) {
  GhostMotion ghost;
  ghost.model.mass_kg = 0.4;
  ghost.model.axis_count = 1;
  ghost.model.axes[0] = {.normal = -Vec3::UnitX(), .coulomb_limit_n = limit_n};
  return ghost;
}

/// A mass m that pushes a ghost with a force and moves with it; returns the velocity after `steps`.
double pushed(GhostMotion& ghost, double m, double force_n, int steps) {
  const double h = 0.001;
  const double total = m + ghost.model.mass_kg;
  Vec3 v = Vec3::Zero();
  for (int i = 0; i < steps; ++i) {
    const Vec3 before = ghost.begin(v, h, kNoLimit_n);
    // Inelastic contact of the two, as an engine solves it.
    const double together = (m * v.x() + force_n * h + ghost.model.mass_kg * before.x()) / total;
    v = Vec3(std::max(together, before.x()), 0, 0);
    ghost.end(before, v, h);
  }
  return v.x();
}

TEST(GhostMotion, SticksUnderItsLimitAndSlidesAboveIt) {
  GhostMotion held = sticking(5.0);
  EXPECT_LT(pushed(held, 0.2, 4.0, 200), 1e-6);
  EXPECT_NEAR(held.load_n.x(), 4.0, 1e-5);  // the load is the push
  GhostMotion slides = sticking(5.0);
  const double speed = pushed(slides, 0.2, 8.0, 200);
  EXPECT_NEAR(speed, (8.0 - 5.0) / 0.6 * 0.2, 0.02);  // (F - c) / (m + M) t
}

// Pushed by a force F, a mass m and a ghost M that a spring K, B holds come to rest at x = F / K: like the formula of
// the damped oscillator, to the first order in the step.
TEST(GhostMotion, GivesWayAsTheSpringOfAnotherUsersDevice) {
  const double h = 0.0005, force_n = 4.0, mass_kg = 0.2, stiffness = 1000.0, damping = 20.0;
  GhostMotion ghost = sticking(0.0);
  double v = 0.0, x = 0.0, worst_m = 0.0;
  const double total_kg = mass_kg + ghost.model.mass_kg;
  const double decay = damping / (2.0 * total_kg), omega = std::sqrt(stiffness / total_kg - decay * decay);
  for (int i = 1; i <= 1000; ++i) {
    // The axis points against x, and so does the pull of a device that stays at x = 0.
    ghost.springs[0] = {.force_n = stiffness * x, .added_kg = h * (damping + h * stiffness)};
    const double before = ghost.begin(Vec3(v, 0, 0), h, kNoLimit_n).x();
    // The pushing mass stays in contact; the ghost moves as an engine would move its mass.
    v = (mass_kg * v + force_n * h + ghost.mass_kg() * before - stiffness * x * h) / (mass_kg + ghost.mass_kg());
    ghost.end(Vec3(before, 0, 0), Vec3(v, 0, 0), h);
    x += h * v;
    const double t_s = h * i;
    const double course = std::cos(omega * t_s) + decay / omega * std::sin(omega * t_s);
    worst_m = std::max(worst_m, std::abs(x - force_n / stiffness * (1.0 - std::exp(-decay * t_s) * course)));
  }
  EXPECT_LT(worst_m, 0.02 * force_n / stiffness);
  EXPECT_NEAR(x, force_n / stiffness, 1e-5);
  EXPECT_NEAR(ghost.load_n.x(), force_n, 0.01);
}

// Equation (17) of common/coupling/README.md; the axis is -x, and the proxy at x = 0.2.
TEST(GhostMotion, AnotherUsersProxyPushesUpToTheLimitAndDoesNotPull) {
  const double h = 0.001;
  const auto pushed_by = [&](double device_x, double speed) {
    const PeerPull peer{.proxy = BodyId{1},
                        .device = {.pose = {.position = Vec3(device_x, 0, 0)}},
                        .coupling = {.stiffness_n_m = 1000.0, .damping_n_s_m = 20.0},
                        .limit_n = 40.0};
    return push_of(peer, -Vec3::UnitX(), -0.2, speed, h);
  };
  EXPECT_NEAR(pushed_by(0.197, 0.0).force_n, 3.0, 1e-9);
  EXPECT_NEAR(pushed_by(0.197, 0.0).added_kg, h * (20.0 + h * 1000.0), 1e-12);
  EXPECT_EQ(pushed_by(0.203, 0.0).force_n, 0.0) << "the device retreats";
  EXPECT_EQ(pushed_by(0.197, 0.2).force_n, 0.0) << "the proxy moves away faster than the spring follows";
  EXPECT_EQ(pushed_by(0.1, 0.0).force_n, 40.0);
  EXPECT_EQ(pushed_by(0.1, 0.0).added_kg, 0.0) << "a constant force";
}

TEST(GhostMotion, HoldsHarderWhatIsPressedDown) {
  const double h = 0.001;
  const auto slowed = [&](double down_n) {
    GhostMotion ghost = sticking(5.0);
    ghost.model.load_n = Vec3(8, 0, -1);
    ghost.model.axes[0].load_dependent_friction = Vec3(0, 0, -0.5);
    ghost.load_n = Vec3(8, 0, -down_n);
    return (1.0 - ghost.begin(Vec3(1, 0, 0), h, kNoLimit_n).x()) * ghost.model.mass_kg / h;
  };
  EXPECT_NEAR(slowed(1.0), 5.0, 1e-9);
  EXPECT_NEAR(slowed(3.0), 6.0, 1e-9);
  EXPECT_NEAR(slowed(-20.0), 0.0, 1e-9) << "lifted, it slides freely, and is not driven";
}

TEST(GhostMotion, AWallOnlyCreeps) {
  GhostMotion wall = sticking(1e9);
  wall.model.mass_kg = 1e5;
  for (const double speed : {0.0, 0.5, -0.5}) {
    const double creeps = wall.begin(Vec3(speed, 0, 0), 0.001, kNoLimit_n).x();
    EXPECT_NEAR(creeps, std::clamp(speed, -1e-3, 1e-3), 1e-12);
  }
}

// Between two walls that overlap a body, an engine's push grows by a share in each step, as at the start of this test.
TEST(GhostMotion, AWallGivesWayToALoadThatNothingInTheSceneCanExert) {
  const double h = 0.001;
  const double spare_n = 10.0;
  for (const double mass_kg : {0.4, 1e5}) {
    GhostMotion wall = sticking(1e9);
    wall.model.mass_kg = mass_kg;
    wall.model.axes[0].force_n = 5.0;
    wall.load_n = Vec3(14, 0, 0);
    EXPECT_LE(wall.begin(Vec3::Zero(), h, spare_n).x(), 0.0) << "it holds";
    wall.load_n = Vec3(300, 0, 0);
    const Vec3 start = wall.begin(Vec3::Zero(), h, spare_n);
    EXPECT_GT(start.x() + 300.0 / mass_kg * h, 0.015) << mass_kg << " kg: under that load it ends on its way out";
    EXPECT_GT(start.x(), -10.5 / mass_kg * h) << "and begins against no more than it may have to carry";
  }
}

TEST(GhostMotion, MovesAcrossItsAxisAsTheWorldsBody) {
  GhostMotion ghost = sticking(5.0);
  ghost.world_velocity = Vec3(0.3, 0.1, -0.2);
  EXPECT_LT((ghost.begin(Vec3::Zero(), 0.001, kNoLimit_n) - Vec3(0, 0.1, -0.2)).norm(), 1e-12);
}

/// A carried ghost and the body by which the engine represents it, under a constant push of the inside.
struct CarriedRun {
  Body body = test::cube(BodyId{0}, 0.1, kCube_kg);
  CarriedMotion motion;
  Vec6 velocity = Vec6::Zero();  ///< of the engine's body

  void step(const Vec3& force_n, const Vec3& torque_n_m, double h) {
    const Vec6 start = motion.begin(body, Quat::Identity(), h);
    velocity = start;
    velocity.head<3>() += h / body.mass * force_n;
    velocity.tail<3>() += h * torque_n_m.cwiseQuotient(body.inertia);
    motion.end(body, Quat::Identity(), start, velocity, h);
  }
};

TEST(CarriedMotion, FallsUnderItsWeight) {
  CarriedRun run;
  run.motion.follow(*carried().models({BodyId{1}}).at(0).carried);
  for (int i = 0; i < 100; ++i) run.step(Vec3::Zero(), Vec3::Zero(), 0.001);
  EXPECT_LT((run.velocity - (Vec6() << 0, 0, -0.981, 0, 0, 0).finished()).norm(), 1e-9) << "it falls and does not turn";
}

// A push through the centre of mass translates the assembly; an off-centre push also turns it.
TEST(CarriedMotion, IsAsHeavyAsTheWholeThatItCarries) {
  const CarriedBody whole = *carried().models({BodyId{1}}).at(0).carried;
  const Vec3 push(0, 3, 0);
  CarriedRun run;
  run.motion.follow(whole);
  run.motion.drive.setZero();
  const double t = 0.2, h = 0.001;
  for (int i = 0; i < 200; ++i) run.step(push, Vec3::Zero(), h);
  const Vec3 turn = whole.inertia_kg_m2.ldlt().solve(Vec3((-whole.centre_m).cross(push) * t));
  const Vec3 speed = push * t / whole.mass_kg + turn.cross(-whole.centre_m);
  EXPECT_LT((run.velocity.tail<3>() - turn).norm(), 1e-9 * turn.norm());
  EXPECT_LT((run.velocity.head<3>() - speed).norm(), 1e-9 * speed.norm());
}

/// Mass m and a carried ghost in one inelastic contact along z; checks the impulse between them after `steps`.
TEST(CarriedMotion, SettlesOnWhatIsLighterAndOnWhatIsHeavier) {
  for (const double m : {0.001, 0.2, 50.0}) {
    CarriedRun run;
    CarriedBody whole = *carried().models({BodyId{1}}).at(0).carried;
    whole.centre_m.setZero();
    run.motion.follow(whole);
    const double h = 0.001, lift_n = 10.0;
    double v = 0.0, pressed_n = 0.0;
    for (int i = 0; i < 3000; ++i) {
      const Vec6 start = run.motion.begin(run.body, Quat::Identity(), h);
      const double free = v + (lift_n / m - 9.81) * h;
      const double together = (m * free + run.body.mass * start[2]) / (m + run.body.mass);
      pressed_n = run.body.mass * (together - start[2]) / h;
      v = together;
      Vec6 after = start;
      after[2] = together;
      run.motion.end(run.body, Quat::Identity(), start, after, h);
    }
    const double total = m + whole.mass_kg;
    EXPECT_NEAR(pressed_n, whole.mass_kg * lift_n / total, 1e-6) << "m = " << m;
    EXPECT_NEAR(v, 3.0 * (lift_n / total - 9.81), 0.01 * std::abs(v)) << "m = " << m;
  }
}

}  // namespace
}  // namespace subworld
