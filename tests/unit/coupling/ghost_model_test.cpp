#include "coupling/schemes/reduced/ghost_model.hpp"
#include "support/outside.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace subworld {
namespace {

using test::carried;
using test::kCube_kg;
using test::kFloor;
using test::kStep_s;
using test::kWeight_n;
using test::Outside;

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

// Cube 4 lies beside both.
TEST(GhostModel, ABodyBesideTwoThatArePushedAddsItsMassOnce) {
  Outside o(4);
  o.touch(1, 2, -Vec3::UnitX(), 1.0);
  o.touch(2, 3, -Vec3::UnitX(), 0.5);
  o.touch(2, 4, -Vec3::UnitY(), 1.0);
  o.touch(3, 4, -Vec3::UnitY(), 1.0);
  EXPECT_NEAR(o.models({BodyId{1}}).at(0).mass_kg, 3 * kCube_kg, 1e-12);
}

// Cube 3 is at the border itself, because it may hit another body: the sub-world has its contact with 2.
TEST(GhostModel, APushedGhostIsNotPartOfItsPusher) {
  const auto models = row(3.0).models({BodyId{1}}, Vec3(0.05, 0, 0), Vec3::Zero(), {BodyId{3}});
  ASSERT_EQ(models.size(), 2U);
  EXPECT_FALSE(models[0].approaching);
  EXPECT_NEAR(models[0].mass_kg, kCube_kg, 1e-12);
  EXPECT_LT((models[0].load_n - Vec3(1.5, 0, 0)).norm(), 1e-12) << "without the share of 3";
  EXPECT_NEAR(models[0].axes[0].coulomb_limit_n, 1.5, 1e-9);
  EXPECT_EQ(models[1].outside, BodyId{3});
  EXPECT_TRUE(models[1].approaching);
  EXPECT_NEAR(models[1].axes[0].coulomb_limit_n, 1.5, 1e-9);
}

// Cube 3 is the proxy of another user, whose device pushes it with 4 N towards the border; 5 N arrive there.
TEST(GhostModel, AnotherUsersPushIsNoFriction) {
  Outside o = row(5.0);
  o.positions = {Vec3::Zero(), Vec3::Zero(), Vec3(0.1, 0, 0), Vec3(0.22, 0, 0)};
  const double friction_n = 0.5 * 2 * kWeight_n;
  EXPECT_NEAR(o.models({BodyId{1}}).at(0).axes[0].coulomb_limit_n, 5.0, 1e-9) << "unknown, it looks like friction";
  EXPECT_TRUE(o.peers.empty());
  o.pulls = {{BodyId{3}, Vec3(-4, 0, 0)}};
  const GhostModel ghost = o.models({BodyId{1}}).at(0);
  EXPECT_NEAR(ghost.axes[0].coulomb_limit_n, std::max(friction_n, 1.0), 1e-9);
  ASSERT_EQ(o.peers.size(), 1U);
  EXPECT_EQ(o.peers[0].outside, BodyId{2});
  EXPECT_EQ(o.peers[0].proxy, BodyId{3});
  EXPECT_NEAR(o.peers[0].offset_m, -0.12, 1e-12) << "along the axis, which points to the inside";
  EXPECT_NEAR(ghost.axes[0].force_n, 0.0, 1e-9) << "the spring is not part of the ghost's own force";
  o.pulls[0].spring = false;  // the operator of an admittance device
  const GhostModel forced = o.models({BodyId{1}}).at(0);
  EXPECT_NEAR(forced.axes[0].force_n, 4.0, 1e-9);
  EXPECT_NEAR(forced.axes[0].coulomb_limit_n, ghost.axes[0].coulomb_limit_n, 1e-9);
  EXPECT_TRUE(o.peers.empty());
  o.pulls[0].spring = true;
  EXPECT_TRUE((o.models({BodyId{1}, BodyId{2}, BodyId{3}}), o.peers.empty())) << "its proxy is a member";
}

TEST(GhostModel, ASlidingBodyResistsWithTheForceThatPushesIt) {
  const auto models = row(3.0).models({BodyId{1}}, Vec3(0.05, 0, 0));
  EXPECT_NEAR(models.at(0).axes[0].coulomb_limit_n, 3.0, 1e-9);
}

// 3 N push two cubes; their acceleration of 2 m/s^2 takes 0.8 N; the rest is friction.
TEST(GhostModel, InertiaOfAnAcceleratingBodyIsNoFriction) {
  const Vec3 velocity(0.05, 0, 0);
  EXPECT_NEAR(row(3.0).models({BodyId{1}}, velocity, Vec3(2, 0, 0)).at(0).axes[0].coulomb_limit_n, 2.2, 1e-9);
  EXPECT_NEAR(row(3.0).models({BodyId{1}}, velocity, Vec3(-2, 0, 0)).at(0).axes[0].coulomb_limit_n, 3.8, 1e-9);
}

// Cube 2 hits 3: the momentum that 2 loses, 3 gains, so neither is friction that holds both.
TEST(GhostModel, AnImpactWithinTheOutsideIsNoFriction) {
  Outside o = row(1.0);
  o.accelerations = {Vec3::Zero(), Vec3::Zero(), Vec3(-12, 0, 0), Vec3(12, 0, 0)};
  EXPECT_NEAR(o.models({BodyId{1}}, Vec3(0.05, 0, 0)).at(0).axes[0].coulomb_limit_n, 1.0, 1e-9);
}

/// The inside 1 pushes 2, which is round, along x with `load_n`.
Outside pushed_round(ShapeKind kind, const Vec3& axis, double load_n) {
  Outside o(2);
  Body& round = o.scene.bodies[2];
  round.shape = {.kind = kind, .radius = 0.05, .half_length = 0.05};
  round.inertia = Vec3(1, 1, kind == ShapeKind::sphere ? 0.4 : 0.5) * kCube_kg * 0.05 * 0.05;
  o.orientation = Quat::FromTwoVectors(Vec3::UnitZ(), axis);
  o.touch(2, 0, Vec3::UnitZ(), kWeight_n);
  o.touch(1, 2, -Vec3::UnitX(), load_n);
  return o;
}

// Its rotation rubs on the body that pushes it, and this friction resists.
TEST(GhostModel, FrictionAtThePusherResistsARollingBody) {
  for (const auto& [kind, mass_kg] :
       {std::pair{ShapeKind::sphere, 1.4 * kCube_kg}, {ShapeKind::cylinder, 1.5 * kCube_kg}}) {
    const Vec3 acceleration(0.2 / mass_kg, 0, 0);
    const GhostModel ghost =
        pushed_round(kind, Vec3(0, 1, 0), 0.4).models({BodyId{1}}, Vec3(0.05, 0, 0), acceleration).at(0);
    EXPECT_NEAR(ghost.mass_kg, mass_kg, 1e-12);
    EXPECT_NEAR(ghost.axes[0].coulomb_limit_n, 0.5 * 0.4, 1e-12);
  }
}

TEST(GhostModel, ABodyNotRoundAboutThatAxisOrPressedTooHardSlides) {
  const auto slides = [](Outside o) {
    const GhostModel ghost = o.models({BodyId{1}}).at(0);
    EXPECT_NEAR(ghost.mass_kg, kCube_kg, 1e-12);
    EXPECT_GE(ghost.axes[0].coulomb_limit_n, 0.5 * kWeight_n - 1e-12);
    EXPECT_LT(ghost.axes[0].load_dependent_friction.x(), 1e-12);
  };
  slides(pushed_round(ShapeKind::cylinder, Vec3(1, 0, 0), 0.4));  // its axis is along the push
  slides(pushed_round(ShapeKind::cylinder, Vec3(0, 0, 1), 0.4));  // upright
  slides(pushed_round(ShapeKind::sphere, Vec3(0, 0, 1), 1.5 * kWeight_n));
}

// Friction at the border presses the outside down by 0.3 N. This is part of the load, and half of any increase is
// friction.
TEST(GhostModel, ALoadThatPressesTheOutsideDownAddsFriction) {
  Outside o = row(3.0);
  o.touch(2, 0, Vec3::UnitZ(), kWeight_n / 2);  // its support has two contacts
  o.contacts[3].tangential_impulse = Vec3(0, 0, 0.3 * kStep_s);
  const GhostModel ghost = o.models({BodyId{1}}).at(0);
  EXPECT_LT((ghost.load_n - Vec3(3, 0, -0.3)).norm(), 1e-12);
  EXPECT_LT((ghost.axes[0].load_dependent_friction - Vec3(0, 0, -0.5)).norm(), 1e-12);
}

// For any contacts and loads: the sum of the loads may have no new component across the existing axes.
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

// Cube 3, also inside, leans on the outside body and presses it onto the floor. Along the floor it can be pushed.
TEST(GhostModel, ABodyPressedObliquelyOnItsSupportSlidesAlongIt) {
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

// The gap was 2 cm, and 5 cm have been covered since: the ghost starts 3 cm further back, in contact.
TEST(GhostModel, AnApproachingBodyThatIsTooNearStartsInContact) {
  GhostModel ghost{.outside = BodyId{2}, .axis_count = 1, .axes = {}};
  ghost.axes[0].normal = -Vec3::UnitX();
  const std::vector<BoundaryContact> border{
      {.inside = BodyId{1}, .outside = BodyId{2}, .normal = -Vec3::UnitX(), .distance = 0.02}};
  const auto moved_by = [&](double x) { return clearance(ghost, border, [x](BodyId) { return Vec3(x, 0, 0); }); };
  EXPECT_LT((moved_by(0.05) - Vec3(0.03, 0, 0)).norm(), 1e-12);
  EXPECT_LT(moved_by(0.01).norm(), 1e-12);
}

TEST(GhostModel, AWallBehindTheOutsideGivesNothing) {
  Outside o = row(2.0);
  Body wall;
  wall.id = BodyId{4};
  o.scene.bodies.push_back(wall);
  o.touch(3, 4, -Vec3::UnitX(), 1.0);
  const auto models = o.models({BodyId{1}});
  EXPECT_GE(models.at(0).axes[0].coulomb_limit_n, 1e8);
  EXPECT_NEAR(models[0].axes[0].force_n, 2.0, 1e-9);  // it still carries its load
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

TEST(GhostModel, ABodySupportedOnlyByTheInsideIsARigidBody) {
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

// Cube 1 is inside and carries cubes 2 and 3, on which cube 4 lies: with three quarters of its weight on cube 2.
TEST(GhostModel, GhostsShareWhatTheyCarryTogetherAsItsLoad) {
  Outside o(4);
  o.touch(2, 1, Vec3::UnitZ(), 1.75 * kWeight_n);
  o.touch(3, 1, Vec3::UnitZ(), 1.25 * kWeight_n);
  o.touch(4, 2, Vec3::UnitZ(), 0.75 * kWeight_n);
  o.touch(4, 3, Vec3::UnitZ(), 0.25 * kWeight_n);
  const auto ghosts = o.models({BodyId{1}});
  ASSERT_TRUE(ghosts.at(0).carried && ghosts.at(1).carried);
  EXPECT_NEAR(ghosts[0].carried->mass_kg, 1.75 * kCube_kg, 1e-9);
  EXPECT_NEAR(ghosts[1].carried->mass_kg, 1.25 * kCube_kg, 1e-9);
  EXPECT_NEAR(ghosts[0].carried->drive.force.z(), -1.75 * kWeight_n, 1e-9);
}

TEST(GhostModel, ABodySupportedFromOutsideIsNotCarried) {
  Outside leans = carried();
  leans.touch(3, 4, Vec3::UnitX(), 0.1);
  EXPECT_TRUE(leans.models({BodyId{1}}).at(0).carried) << "only the inside supports cube 4";
  leans.touch(4, 0, Vec3::UnitZ(), kWeight_n);
  EXPECT_FALSE(leans.models({BodyId{1}}).at(0).carried) << "the floor supports cube 4";
  Outside stiff = carried();
  stiff.scene.bodies[3].rotates = false;
  EXPECT_FALSE(stiff.models({BodyId{1}}).at(0).carried);
}

// A cube that touches one with a support is held along x, and not along y.
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

}  // namespace
}  // namespace subworld
