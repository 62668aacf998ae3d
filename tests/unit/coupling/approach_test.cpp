#include "coupling/schemes/reduced/approach.hpp"
#include "coupling/select/border.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <optional>
#include <set>

namespace subworld {
namespace {

constexpr double kTime_s = 0.04;
constexpr double kSide_m = 0.1;

/// Body 0 is inside, body 1 outside.
struct Two {
  Two() {
    scene.bodies = {test::cube(BodyId{0}, kSide_m), test::cube(BodyId{1}, kSide_m)};
    states.resize(2);
  }
  std::vector<BoundaryContact> near(double gravity_m_s2 = 0.0) {
    scene.settings.world.gravity = Vec3(0, 0, -gravity_m_s2);
    const Membership membership{{BodyId{0}}, {}};
    ContactGraph graph;
    graph.build(contacts, scene.bodies.size());
    ApproachFinder finder(scene);
    finder.begin(kTime_s);
    const auto bounds = [&](BodyId id) {
      const Vec3& centre = states[index(id)].position;
      return Box{centre - Vec3::Constant(half_m), centre + Vec3::Constant(half_m)};
    };
    const auto state = [&](BodyId id) { return states[index(id)]; };
    finder.inside(BodyId{0}, state(BodyId{0}), bounds(BodyId{0}));
    Box reach = swept_bounds(state(BodyId{0}), bounds(BodyId{0}), gravity_m_s2, kTime_s);
    std::vector<BoundaryContact> border;
    extract_border(contacts, membership, border);
    for (const BodyId id : finder.touching(membership, graph, border)) {
      reach.extend(finder.ghost(id, state(id), bounds(id)));
    }
    for (std::optional<Box> where = reach; where; where = finder.find(membership, graph, border)) {
      for (std::uint32_t i = 0; i < states.size(); ++i) {
        if (finder.may_come(BodyId{i})) finder.outside(BodyId{i}, state(BodyId{i}), bounds(BodyId{i}), *where);
      }
    }
    return border;
  }
  Scene scene;
  std::vector<BodyState> states;
  std::vector<Contact> contacts;
  double half_m = 0.5 * std::numbers::sqrt3 * kSide_m;  ///< of a cube that is turned by any angle
};

// 10 mm apart, 0.3 m/s: contact in 33 ms.
TEST(Approach, ABodyThatWillTouchWithinTheTimeIsAtTheBorder) {
  Two two;
  two.states[1] = test::at(0.11, 0.02, 0);
  two.states[0].linear_velocity.x() = 0.3;
  const auto border = two.near();
  ASSERT_EQ(border.size(), 1U);
  EXPECT_EQ(border[0].inside, BodyId{0});
  EXPECT_EQ(border[0].outside, BodyId{1});
  EXPECT_LT((border[0].normal + Vec3::UnitX()).norm(), 1e-12);
  EXPECT_NEAR(border[0].distance, 0.01, 1e-12);
  EXPECT_NEAR(border[0].point.x(), 0.05, 1e-12);
  EXPECT_EQ(border[0].normal_impulse, 0.0);
}

// Where everything comes, as under a heap that falls, a frame names the nearest only.
TEST(Approach, OfManyBodiesThatComeTheFirstOnesAreAtTheBorder) {
  constexpr int kSide = 6;
  Two two;
  two.scene.bodies.resize(1);
  two.states.resize(1);
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    two.scene.bodies.push_back(test::cube(BodyId(i + 1), kSide_m));
    const double x = i % kSide - 0.5 * (kSide - 1), y = i / kSide % kSide - 0.5 * (kSide - 1),
                 z = 1 + i / kSide / kSide;
    two.states.push_back(test::at(0.12 * x, 0.12 * y, 0.12 * z));
    two.states.back().linear_velocity.z() = -3.0 * z;
  }
  const auto border = two.near();
  std::set<BodyId> outside, of_inside;
  for (const BoundaryContact& pair : border) {
    outside.insert(pair.outside);
    if (pair.inside == BodyId{0}) of_inside.insert(pair.outside);
  }
  EXPECT_EQ(outside.size(), 64U);
  EXPECT_GE(of_inside.size(), 4U) << "the four over the inside";
}

// All of them come to one place, so that each may meet each.
TEST(Approach, OfManyPairsTheFirstOnesAreAtTheBorder) {
  Two two;
  two.scene.bodies.resize(1);
  two.states.resize(1);
  for (int i = 0; i < 100; ++i) {
    two.scene.bodies.push_back(test::cube(BodyId(i + 1), kSide_m));
    two.states.push_back(test::at(0.3 * (i % 10 - 4.5), 0.3 * (i / 10 - 4.5), 0.3));
    two.states.back().linear_velocity = -two.states.back().position / kTime_s;
  }
  EXPECT_EQ(two.near().size(), 512U);
}

TEST(Approach, ASlowOrRecedingBodyIsNot) {
  Two two;
  two.states[1] = test::at(0.11, 0, 0);
  two.states[0].linear_velocity.x() = 0.2;
  EXPECT_TRUE(two.near().empty());
  two.states[0].linear_velocity.x() = -0.3;
  EXPECT_TRUE(two.near().empty());
  two.states[1].linear_velocity.x() = -0.7;
  EXPECT_EQ(two.near().size(), 1U);
}

// Both may fall by g t^2 / 2, 7.8 mm.
// 30 cm away, 8 m/s.
TEST(Approach, AFastBodyIsFoundFromAfar) {
  Two two;
  two.states[1] = test::at(0, 0, 0.4);
  two.states[1].linear_velocity.z() = -8;
  EXPECT_EQ(two.near().size(), 1U);
  two.states[1].linear_velocity = Vec3(8, 0, 0);
  EXPECT_TRUE(two.near().empty());
}

TEST(Approach, FallingCounts) {
  Two two;
  two.states[1] = test::at(0, 0, 0.115);
  EXPECT_TRUE(two.near(0.0).empty());
  EXPECT_EQ(two.near(9.81).size(), 1U);
  two.states[1] = test::at(0, 0, 0.117);
  EXPECT_TRUE(two.near(9.81).empty());
}

// 20 rad/s move a corner by up to 69 mm.
TEST(Approach, TurningCounts) {
  Two two;
  two.states[1] = test::at(0.15, 0, 0);
  EXPECT_TRUE(two.near().empty());
  two.states[1].angular_velocity.z() = 20.0;
  EXPECT_EQ(two.near().size(), 1U);
}

// Side by side over an edge, they pass each other.
TEST(Approach, NeighboursOverAnEdgeDoNotTouch) {
  Two two;
  two.states[1] = test::at(0.101, 0.1, 0);
  two.states[0].linear_velocity.x() = 0.3;
  EXPECT_TRUE(two.near().empty());
  two.states[1] = test::at(0.101, 0.098, 0);
  EXPECT_EQ(two.near().size(), 1U);
  two.states[1] = test::at(0.101, 0.102, 0);
  two.states[1].linear_velocity.y() = -0.1;  // 4 mm sideways, before they have passed
  EXPECT_EQ(two.near().size(), 1U);
}

TEST(Approach, TheGapIsThatOfTheTurnedFaces) {
  Two two;
  const Quat turned(Eigen::AngleAxisd(0.4, Vec3::UnitY()));
  for (BodyState& state : two.states) state.orientation = turned;
  two.states[1].position = turned * Vec3(0.11, 0.01, 0.02);
  two.states[0].linear_velocity = turned * Vec3(0.3, 0, 0);
  const auto border = two.near();
  ASSERT_EQ(border.size(), 1U);
  EXPECT_LT((border[0].normal + turned * Vec3::UnitX()).norm(), 1e-12);
  EXPECT_NEAR(border[0].distance, 0.01, 1e-12);
}

TEST(Approach, RoundShapesAreAsWideAsTheyAre) {
  Two two;
  Shape& ball = two.scene.bodies[0].shape;
  ball = {.kind = ShapeKind::sphere, .radius = 0.03};
  two.states[1] = test::at(0.09, 0, 0);
  two.states[0].linear_velocity.x() = 0.3;
  ASSERT_EQ(two.near().size(), 1U);
  EXPECT_NEAR(two.near()[0].distance, 0.01, 1e-12);

  two.scene.bodies[1].shape = {.kind = ShapeKind::cylinder, .radius = 0.03, .half_length = 0.2};
  two.states[1] = test::at(0.05, 0.05, 0);
  two.states[0].linear_velocity = Vec3(0.2, 0.2, 0);
  ASSERT_EQ(two.near().size(), 1U);
  EXPECT_NEAR(two.near()[0].distance, 0.05 * std::numbers::sqrt2 - 0.06, 1e-12);
  EXPECT_NEAR(two.near()[0].normal.dot(Vec3(-1, -1, 0).normalized()), 1.0, 1e-12);

  two.half_m = 0.25;
  two.scene.bodies[1].shape = {.kind = ShapeKind::capsule, .radius = 0.03, .half_length = 0.2};
  two.states[1] = test::at(0, 0, 0.27);
  two.states[0].linear_velocity = Vec3(0, 0, 0.3);
  ASSERT_EQ(two.near().size(), 1U);
  EXPECT_NEAR(two.near()[0].distance, 0.01, 1e-12);
}

TEST(Approach, AHullReachesToItsVertices) {
  Two two;
  two.scene.meshes.push_back(
      {.file = "wedge", .vertices = {{-0.05, 0.1, 0}, {0.05, 0, 0}, {-0.05, -0.1, 0}, {0, 0, 0.1}}, .triangles = {}});
  two.scene.bodies[1].shape = {.kind = ShapeKind::convex, .mesh = 0};
  two.states[1] = test::at(0.11, 0, 0);
  two.states[0].linear_velocity.x() = 0.3;
  const auto border = two.near();
  ASSERT_EQ(border.size(), 1U);
  EXPECT_NEAR(border[0].distance, 0.01, 1e-12);
}

TEST(Approach, ATouchingBodyIsAlreadyAtTheBorder) {
  Two two;
  two.states[1] = test::at(0.1, 0, 0);
  two.states[0].linear_velocity.x() = 0.3;
  two.contacts.push_back({.a = BodyId{0}, .b = BodyId{1}, .normal = -Vec3::UnitX(), .normal_impulse = 0.1});
  const auto border = two.near();
  ASSERT_EQ(border.size(), 1U);
  EXPECT_EQ(border[0].normal_impulse, 0.1);
}

// A third cube is near, but stands on the second, which is in contact: the second represents it.
TEST(Approach, ABodyBehindTheBorderIsRepresentedByIt) {
  Two two;
  two.scene.bodies.push_back(test::cube(BodyId{2}, kSide_m));
  two.states = {test::at(0, 0, 0), test::at(0.1, 0, -0.08), test::at(0.11, 0, 0.02)};
  two.states[0].linear_velocity.x() = 0.3;
  const Contact stands{.a = BodyId{2}, .b = BodyId{1}, .normal = Vec3::UnitZ(), .normal_impulse = 0.1};
  two.contacts = {stands};
  ASSERT_EQ(two.near().size(), 1U);  // nothing touches yet
  EXPECT_EQ(two.near()[0].outside, BodyId{1});
  two.contacts.push_back({.a = BodyId{0}, .b = BodyId{1}, .normal = -Vec3::UnitX(), .normal_impulse = 0.1});
  const auto border = two.near();
  ASSERT_EQ(border.size(), 1U);
  EXPECT_EQ(border[0].outside, BodyId{1});
}

// The member pushes the second cube, the second pushes the third, and the third is close to the fourth. So the third is
// at the border itself, by its contact with the second. Bodies that approach from the side do not count.
TEST(Approach, ABodyBehindTheBorderThatIsPushedIntoAnotherIsAtTheBorder) {
  const auto row = [](const Vec3& fourth, const Vec3& velocity) {
    Two two;
    for (const std::uint32_t i : {2U, 3U}) two.scene.bodies.push_back(test::cube(BodyId{i}, kSide_m));
    two.states = {test::at(0, 0, 0), test::at(0.1, 0, 0), test::at(0.2, 0, 0), {}};
    two.states[3].position = fourth;
    two.states[3].linear_velocity = velocity;
    for (std::size_t i = 0; i < 3; ++i) two.states[i].linear_velocity.x() = 0.3;
    two.contacts = {{.a = BodyId{0}, .b = BodyId{1}, .normal = -Vec3::UnitX(), .normal_impulse = 0.2},
                    {.a = BodyId{1}, .b = BodyId{2}, .normal = -Vec3::UnitX(), .normal_impulse = 0.1}};
    return two.near();
  };
  const auto border = row(Vec3(0.305, 0, 0), Vec3::Zero());
  ASSERT_EQ(border.size(), 3U);
  EXPECT_EQ(border[1].inside, BodyId{1});
  EXPECT_EQ(border[1].outside, BodyId{2});
  EXPECT_EQ(border[1].normal_impulse, 0.1);
  EXPECT_EQ(border[2].inside, BodyId{2});
  EXPECT_EQ(border[2].outside, BodyId{3});
  EXPECT_EQ(border[2].normal_impulse, 0.0);
  EXPECT_EQ(row(Vec3(0.25, 0.105, 0), Vec3(0, -0.3, 0)).size(), 1U);
}

// The third cube is out of reach of the member, but within reach of the second, which the member touches and pushes.
// Then the third is close to a fourth.
TEST(Approach, ABodyThatTheBorderIsPushedIntoIsFoundToo) {
  Two two;
  for (const std::uint32_t i : {2U, 3U}) two.scene.bodies.push_back(test::cube(BodyId{i}, kSide_m));
  two.states = {test::at(0, 0, 0), test::at(0.1, 0, 0), test::at(0.21, 0, 0), test::at(0.311, 0, 0)};
  two.contacts = {{.a = BodyId{0}, .b = BodyId{1}, .normal = -Vec3::UnitX(), .normal_impulse = 0.1}};
  for (int i : {0, 1}) two.states[static_cast<std::size_t>(i)].linear_velocity.x() = 0.3;
  EXPECT_EQ(two.near().size(), 2U);
  const auto border = two.near(2.0);  // both may fall by 1.6 mm
  ASSERT_EQ(border.size(), 3U);
  EXPECT_EQ(border[1].inside, BodyId{1});
  EXPECT_EQ(border[1].outside, BodyId{2});
  EXPECT_EQ(border[2].inside, BodyId{2});
  EXPECT_EQ(border[2].outside, BodyId{3});
  EXPECT_NEAR(border[2].distance, 0.001, 1e-12);
}

}  // namespace
}  // namespace subworld
