#include "coupling/ghost.hpp"
#include "coupling/delay.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace subworld {
namespace {

constexpr double kStep_s = 0.004;
constexpr double kCube_kg = 0.2;
constexpr double kWeight_n = kCube_kg * 9.81;
constexpr BodyId kFloor{0};

/// A floor and cubes; contacts are listed as forces.
struct Outside {
  explicit Outside(std::uint32_t cubes) {
    scene.bodies.push_back(test::floor_plane(kFloor));
    for (std::uint32_t i = 1; i <= cubes; ++i) scene.bodies.push_back(test::cube(BodyId{i}, 0.1, kCube_kg));
  }
  /// `towards`: from b to a.
  void touch(std::uint32_t a, std::uint32_t b, const Vec3& towards, double force_n) {
    contacts.push_back({.a = BodyId{a}, .b = BodyId{b}, .normal = towards, .normal_impulse = force_n * kStep_s});
  }
  std::vector<GhostModel> models(std::vector<BodyId> members, const Vec3& velocity = Vec3::Zero(),
                                 const Vec3& acceleration = Vec3::Zero()) {
    const Membership membership{std::move(members), {kFloor}};
    std::vector<BorderPair> border;
    extract_border(contacts, membership, border);
    ContactGraph graph;
    graph.build(contacts, scene.bodies.size());
    std::vector<GhostModel> out;
    GhostModeller(scene).model(
        border, membership, graph,
        [&](BodyId id) {
          const Vec3 position = positions.empty() ? Vec3::Zero() : positions[index(id)];
          return OutsideMotion{{.position = position, .linear_velocity = velocity}, acceleration};
        },
        kStep_s, out);
    return out;
  }

  Scene scene;
  std::vector<Contact> contacts;
  std::vector<Vec3> positions;  ///< by body; none: all in one place
};

// Cube 1 is inside; 2 and 3 stand behind it on the floor.
Outside row(double load_n) {
  Outside o(3);
  for (std::uint32_t i = 1; i <= 3; ++i) o.touch(i, 0, Vec3::UnitZ(), kWeight_n);
  o.touch(1, 2, -Vec3::UnitX(), load_n);
  o.touch(2, 3, -Vec3::UnitX(), load_n / 2);
  return o;
}

TEST(GhostModel, ARowBehindTheBorderIsItsMassAndItsFriction) {
  const auto models = row(0.5).models({BodyId{1}});
  ASSERT_EQ(models.size(), 1U);
  EXPECT_EQ(models[0].outside, BodyId{2});
  ASSERT_EQ(models[0].axis_count, 1U);
  EXPECT_NEAR(models[0].mass_kg, 2 * kCube_kg, 1e-12);
  EXPECT_LT((models[0].axes[0].normal + Vec3::UnitX()).norm(), 1e-12);
  EXPECT_NEAR(models[0].axes[0].coulomb_limit_n, 0.5 * 2 * kWeight_n, 1e-9);  // mu N of both
  EXPECT_NEAR(models[0].axes[0].force_n, 0.0, 1e-12);
  EXPECT_LT((models[0].load_n - Vec3(0.5, 0, 0)).norm(), 1e-12);
}

TEST(GhostModel, WhatSlidesIsHeldByWhatItIsPushedWith) {
  const auto models = row(3.0).models({BodyId{1}}, Vec3(0.05, 0, 0));
  EXPECT_NEAR(models.at(0).axes[0].coulomb_limit_n, 3.0, 1e-9);
}

// 3 N push two cubes, of which 2 m/s^2 take 0.8 N: what is left is friction.
TEST(GhostModel, WhatAcceleratesIsNotHeldByItsInertia) {
  const Vec3 velocity(0.05, 0, 0);
  EXPECT_NEAR(row(3.0).models({BodyId{1}}, velocity, Vec3(2, 0, 0)).at(0).axes[0].coulomb_limit_n, 2.2, 1e-9);
  EXPECT_NEAR(row(3.0).models({BodyId{1}}, velocity, Vec3(-2, 0, 0)).at(0).axes[0].coulomb_limit_n, 3.8, 1e-9);
}

// Friction at the border draws the outside down by 0.3 N: it is part of the load, and half of more of it is friction.
TEST(GhostModel, WhatPressesTheOutsideDownHoldsIt) {
  Outside o = row(3.0);
  o.touch(2, 0, Vec3::UnitZ(), kWeight_n / 2);  // its support has two contacts
  o.contacts[3].tangential_impulse = Vec3(0, 0, 0.3 * kStep_s);
  const GhostModel ghost = o.models({BodyId{1}}).at(0);
  EXPECT_LT((ghost.load_n - Vec3(3, 0, -0.3)).norm(), 1e-12);
  EXPECT_LT((ghost.axes[0].grip - Vec3(0, 0, -0.5)).norm(), 1e-12);
}

// However contacts lie and whatever they carry: loads may sum up to nothing new across the axes there are.
TEST(GhostModel, AxesAreOrthogonal) {
  std::mt19937 random(7);
  std::normal_distribution<double> any;
  for (int sample = 0; sample < 2000; ++sample) {
    Outside o(2);
    const Vec3 main = Vec3(any(random), any(random), any(random)).normalized();
    for (int k = 0; k < 6; ++k) {
      const Vec3 off(any(random), any(random), any(random));
      const Vec3 normal = k < 2 ? main : (main + off.cross(main)).normalized();
      o.touch(1, 2, normal, k < 2 ? 5.0 : k % 2 == 0 ? 0.0 : std::abs(any(random)));
    }
    const auto models = o.models({BodyId{1}});
    ASSERT_EQ(models.size(), 1U);
    const GhostModel& ghost = models[0];
    for (std::size_t i = 0; i < ghost.axis_count; ++i) {
      ASSERT_NEAR(ghost.axes[i].normal.norm(), 1.0, 1e-12);
      for (std::size_t j = 0; j < i; ++j) {
        ASSERT_NEAR(ghost.axes[i].normal.dot(ghost.axes[j].normal), 0.0, 1e-9) << "sample " << sample;
      }
    }
  }
}

// Cube 3, inside as well, leans on the outside: that presses it on the floor, and along the floor it can be pushed.
TEST(GhostModel, WhatIsPressedAslantOnItsSupportSlidesAlongIt) {
  for (const double slope : {0.35, 0.8, 1.3}) {
    Outside o(3);
    o.touch(2, 0, Vec3::UnitZ(), 6.0);
    o.touch(1, 2, -Vec3::UnitX(), 1.5);
    o.touch(3, 2, Vec3(std::cos(slope), 0, std::sin(slope)), 4.4);
    const GhostModel ghost = o.models({BodyId{1}, BodyId{3}}).at(0);
    ASSERT_EQ(ghost.axis_count, 2U);
    const bool push_first = std::abs(ghost.axes[0].normal.x()) > 0.5;
    const GhostAxis& down = ghost.axes[push_first ? 1 : 0];
    const GhostAxis& push = ghost.axes[push_first ? 0 : 1];
    EXPECT_LT((down.normal - Vec3::UnitZ()).norm(), 1e-12) << slope;
    EXPECT_GT(down.coulomb_limit_n, 1e6);
    EXPECT_NEAR(std::abs(push.normal.x()), 1.0, 1e-12) << slope;
    EXPECT_NEAR(push.coulomb_limit_n, 0.5 * 6.0, 1e-9);
  }
}

TEST(GhostModel, AWallBehindTheOutsideGivesNothing) {
  Outside o = row(2.0);
  Body wall;
  wall.id = BodyId{4};
  o.scene.bodies.push_back(wall);
  o.touch(3, 4, -Vec3::UnitX(), 1.0);
  const auto models = o.models({BodyId{1}});
  EXPECT_GE(models.at(0).axes[0].coulomb_limit_n, 1e8);
  EXPECT_NEAR(models[0].axes[0].force_n, 2.0, 1e-9);  // it goes on carrying what it carries
}

TEST(GhostModel, ALoadOnTopWeighsAndASupportBelowIsAWall) {
  Outside o(3);
  o.touch(1, 0, Vec3::UnitZ(), kWeight_n);
  o.touch(2, 1, Vec3::UnitZ(), 2 * kWeight_n);
  o.touch(3, 2, Vec3::UnitZ(), kWeight_n);
  const auto on_top = o.models({BodyId{1}});
  EXPECT_NEAR(on_top.at(0).mass_kg, 2 * kCube_kg, 1e-12);
  EXPECT_NEAR(on_top[0].axes[0].force_n, 2 * kWeight_n, 1e-9);
  const auto below = o.models({BodyId{3}});
  EXPECT_EQ(below.at(0).outside, BodyId{2});
  EXPECT_NEAR(below[0].axes[0].force_n, kWeight_n, 1e-9);
  EXPECT_GT(below[0].mass_kg, 100.0);
}

// Cube 2 lies on the inside 1 and carries 3.
Outside carried() {
  Outside o(4);
  o.positions = {Vec3(0, 0, 0), Vec3(0, 0, 0.05), Vec3(0, 0, 0.15), Vec3(0.02, 0, 0.25), Vec3(0.1, 0, 0.15)};
  o.touch(1, 0, Vec3::UnitZ(), 3 * kWeight_n);
  o.touch(2, 1, Vec3::UnitZ(), 2 * kWeight_n);
  o.touch(3, 2, Vec3::UnitZ(), kWeight_n);
  return o;
}

TEST(GhostModel, WhatTheInsideAloneHoldsIsARigidBody) {
  const GhostModel ghost = carried().models({BodyId{1}}).at(0);
  ASSERT_TRUE(ghost.carried);
  EXPECT_NEAR(ghost.carried->mass_kg, 2 * kCube_kg, 1e-12);
  EXPECT_LT((ghost.carried->centre_m - Vec3(0.01, 0, 0.05)).norm(), 1e-12);
  const double cube = kCube_kg * 0.1 * 0.1 / 6;
  EXPECT_NEAR(ghost.carried->inertia_kg_m2(0, 0), 2 * (cube + kCube_kg * 0.05 * 0.05), 1e-12);
  EXPECT_NEAR(ghost.carried->inertia_kg_m2(2, 2), 2 * (cube + kCube_kg * 0.01 * 0.01), 1e-12);
  EXPECT_NEAR(ghost.carried->inertia_kg_m2(0, 2), -2 * kCube_kg * 0.01 * 0.05, 1e-12);
  EXPECT_LT((ghost.carried->drive.force - Vec3(0, 0, -2 * kWeight_n)).norm(), 1e-12);
  EXPECT_LT((ghost.carried->drive.torque - Vec3(0, 0.02 * kWeight_n, 0)).norm(), 1e-12);
}

TEST(GhostModel, WhatSomethingElseHoldsIsNotCarried) {
  Outside leans = carried();
  leans.touch(3, 4, Vec3::UnitX(), 0.1);
  EXPECT_TRUE(leans.models({BodyId{1}}).at(0).carried) << "cube 4 hangs on it";
  leans.touch(4, 0, Vec3::UnitZ(), kWeight_n);
  EXPECT_FALSE(leans.models({BodyId{1}}).at(0).carried) << "cube 4 stands on the floor";
  Outside stiff = carried();
  stiff.scene.bodies[3].rotates = false;
  EXPECT_FALSE(stiff.models({BodyId{1}}).at(0).carried);
}

// Cubes 2 and 4 both lie on the inside and touch.
TEST(GhostModel, AnotherGhostPressesACarriedOneAsItDoesInTheWorld) {
  Outside o = carried();
  o.touch(4, 1, Vec3::UnitZ(), kWeight_n);
  o.touch(2, 4, -Vec3::UnitX(), 0.7);
  const auto models = o.models({BodyId{1}});
  ASSERT_EQ(models.size(), 2U);
  ASSERT_TRUE(models[0].carried && models[1].carried);
  EXPECT_NEAR(models[0].carried->mass_kg, 2 * kCube_kg, 1e-12);
  EXPECT_NEAR(models[1].carried->mass_kg, kCube_kg, 1e-12);
  EXPECT_NEAR(models[0].carried->drive.force.x(), -0.7, 1e-12);
  EXPECT_NEAR(models[1].carried->drive.force.x(), 0.7, 1e-12);
}

// Along x a cube that touches one with a stand is held, along y it is not.
TEST(GhostModel, AWayInWhichTheInsideAloneHoldsIsFree) {
  Outside o(3);
  o.touch(1, 0, Vec3::UnitZ(), 2 * kWeight_n);
  o.touch(2, 1, Vec3::UnitZ(), kWeight_n);
  o.touch(3, 0, Vec3::UnitZ(), kWeight_n);
  o.touch(2, 3, Vec3::UnitX(), 0.0);
  const GhostModel beside = o.models({BodyId{1}}).at(0);
  EXPECT_FALSE(beside.carried);
  ASSERT_GE(beside.axis_count, 1U);
  for (std::size_t i = 0; i < beside.axis_count; ++i) EXPECT_NEAR(beside.axes[i].normal.x(), 0.0, 1e-12);
}

// Cube 3 rests on 2, which is outside, and 1 pushes 2: one axis along the row, one up.
TEST(GhostModel, AnOutsideThatIsPushedAndCarriesHasTwoAxes) {
  Outside o(3);
  o.touch(1, 0, Vec3::UnitZ(), kWeight_n);
  o.touch(2, 0, Vec3::UnitZ(), 2 * kWeight_n);
  o.touch(1, 2, -Vec3::UnitX(), 3.0);
  o.touch(3, 2, Vec3::UnitZ(), kWeight_n);
  const auto models = o.models({BodyId{1}, BodyId{3}});
  ASSERT_EQ(models.size(), 1U);
  ASSERT_EQ(models[0].axis_count, 2U);
  EXPECT_NEAR(models[0].axes[0].normal.dot(models[0].axes[1].normal), 0.0, 1e-12);
  EXPECT_NEAR(models[0].mass_kg, kCube_kg, 1e-12) << "the way that gives decides";
}

GhostMotion sticking(double limit_n) {
  GhostMotion ghost;
  ghost.model.mass_kg = 0.4;
  ghost.model.axis_count = 1;
  ghost.model.axes[0] = {.normal = -Vec3::UnitX(), .coulomb_limit_n = limit_n};
  return ghost;
}

/// A mass m, pushed with a force against a ghost and moving with it; returns the velocity after `steps`.
double pushed(GhostMotion& ghost, double m, double force_n, int steps) {
  const double h = 0.001;
  const double total = m + ghost.model.mass_kg;
  Vec3 v = Vec3::Zero();
  for (int i = 0; i < steps; ++i) {
    const Vec3 before = ghost.begin(v, h);
    // An inelastic contact of both, as an engine solves it.
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

TEST(GhostMotion, HoldsHarderWhatIsPressedDown) {
  const double h = 0.001;
  const auto slowed = [&](double down_n) {
    GhostMotion ghost = sticking(5.0);
    ghost.model.load_n = Vec3(8, 0, -1);
    ghost.model.axes[0].grip = Vec3(0, 0, -0.5);
    ghost.load_n = Vec3(8, 0, -down_n);
    return (1.0 - ghost.begin(Vec3(1, 0, 0), h).x()) * ghost.model.mass_kg / h;
  };
  EXPECT_NEAR(slowed(1.0), 5.0, 1e-9);
  EXPECT_NEAR(slowed(3.0), 6.0, 1e-9);
  EXPECT_NEAR(slowed(-20.0), 0.0, 1e-9) << "lifted, it slides freely, and is not driven";
}

TEST(GhostMotion, AWallOnlyCreeps) {
  GhostMotion wall = sticking(1e9);
  wall.model.mass_kg = 1e5;
  for (const double speed : {0.0, 0.5, -0.5}) {
    const double creeps = wall.begin(Vec3(speed, 0, 0), 0.001).x();
    EXPECT_NEAR(creeps, std::clamp(speed, -1e-3, 1e-3), 1e-12);
  }
}

TEST(GhostMotion, MovesAcrossItsAxisAsTheWorldsBody) {
  GhostMotion ghost = sticking(5.0);
  ghost.world_velocity = Vec3(0.3, 0.1, -0.2);
  EXPECT_LT((ghost.begin(Vec3::Zero(), 0.001) - Vec3(0, 0.1, -0.2)).norm(), 1e-12);
}

/// A carried ghost and the body that an engine moves for it, under a constant push of the inside.
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

// A push through the centre of mass moves the whole, one beside it also turns it.
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

/// Mass m and a carried ghost in one inelastic contact along z; the impulse between them after `steps`.
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

TEST(Islands, AreOpenWhereTheyReachOut) {
  Islands islands;
  const std::vector<BodyId> ids{BodyId{1}, BodyId{2}, BodyId{3}, BodyId{5}};
  islands.begin(ids);
  islands.join(BodyId{1}, BodyId{2});
  islands.join(BodyId{3}, BodyId{9});
  EXPECT_FALSE(islands.is_open(BodyId{1}));
  EXPECT_TRUE(islands.is_open(BodyId{3}));
  EXPECT_TRUE(islands.is_open(BodyId{9}));
  std::vector<std::uint32_t> labels;
  islands.labels(labels);
  EXPECT_EQ(labels[0], labels[1]);
  EXPECT_EQ(labels[2], kOpenIsland);
  EXPECT_NE(labels[3], labels[0]);
  // The other side sees 2 touch 3: now all of it is open.
  Islands both;
  both.begin(ids);
  both.join(ids, labels);
  both.join(BodyId{2}, BodyId{3});
  EXPECT_TRUE(both.is_open(BodyId{1}));
  EXPECT_FALSE(both.is_open(BodyId{5}));
}

TEST(Delay, AFrameIsLateByBothDirectionsWhereTheWorldTrails) {
  Settings settings;
  settings.ratio = 5;
  settings.delay = {.up_s = 0.004, .down_s = 0.006};
  const Delay parallel(settings, 0, 0);
  EXPECT_EQ(parallel.frame_due(3), 3U * 5 + 6);
  EXPECT_EQ(parallel.report_due(3), 4U);
  const Delay trailing(settings, 1, 0);
  EXPECT_EQ(trailing.frame_due(3), 3U * 5 + 5 + 10);
  EXPECT_EQ(trailing.report_due(3), 2U);
}

TEST(Delay, JitterRepeatsAndStaysInItsBounds) {
  Settings settings;
  settings.ratio = 5;
  settings.delay = {.up_s = 0.004, .down_s = 0.006, .jitter_s = 0.01};
  const Delay delay(settings, 1, 0);
  std::uint64_t least = 1000, most = 0;
  for (std::uint64_t j = 1; j < 1000; ++j) {
    const std::uint64_t late = delay.frame_due(j) - 5 * j - 5;
    EXPECT_EQ(delay.frame_due(j), Delay(settings, 1, 0).frame_due(j));
    least = std::min(least, late);
    most = std::max(most, late);
  }
  EXPECT_GE(least, 10U);
  EXPECT_LE(most, 30U);
  EXPECT_GT(most, least + 10);
}

}  // namespace
}  // namespace subworld
