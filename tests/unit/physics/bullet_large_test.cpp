// Bullet's preset large: contacts that are found ahead and hold for several steps.

#include "model/shapes/mass_properties.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace subworld {
namespace {

using test::kFloor;

constexpr double kCycle_s = 0.016;

/// At `dt`; of a cycle the engine searches once, with shorter steps it follows.
class BulletLarge : public testing::TestWithParam<test::Tested> {
 protected:
  BulletLarge() : engine(GetParam().make()) {}

  BodyId add(const Shape& shape, double mass, const BodyState& state) {
    Body body;
    body.id = BodyId{count++};
    body.shape = shape;
    body.mass = mass;
    if (mass > 0.0) body.inertia = principal_inertia(shape, mass);
    engine->add(body, state);
    return body.id;
  }
  BodyId add_cube(const Vec3& position, const Vec3& velocity = Vec3::Zero()) {
    BodyState state;
    state.position = position;
    state.linear_velocity = velocity;
    return add({.kind = ShapeKind::box, .half_extents = Vec3::Constant(0.5)}, 1000.0, state);
  }
  void add_floor(double angle = 0.0) {
    BodyState state;
    state.orientation = Quat(Eigen::AngleAxisd(angle, Vec3::UnitY()));
    add({.kind = ShapeKind::plane}, 0.0, state);
  }
  /// Returns the deepest contact, m.
  double run(double seconds) {
    double deepest = 0.0;
    for (int i = 0; i < GetParam().steps(seconds); ++i) {
      engine->step(GetParam().dt);
      for (const Contact& contact : engine->contacts()) deepest = std::max(deepest, -contact.distance);
    }
    return deepest;
  }
  [[nodiscard]] Vec3 place(BodyId id) const { return engine->state(id).position; }

  std::unique_ptr<Engine> engine;
  std::uint32_t count = 0;
};

// 10 m/s are 16 cm in a cycle.
TEST_P(BulletLarge, AFastCubeStopsAtTheGround) {
  add_floor();
  const BodyId cube = add_cube({0, 0, 5.6}, {0, 0, -10});
  EXPECT_LT(run(2.0), 5e-3);
  EXPECT_NEAR(place(cube).z(), 0.5, 1e-3);
}

TEST_P(BulletLarge, CubesThatMeetInTheAirStopEachOther) {
  const BodyId left = add_cube({-2, 0, 50}, {8, 0, 0}), right = add_cube({2, 0.1, 50}, {-8, 0, 0});
  EXPECT_LT(run(0.5), 5e-3);
  EXPECT_GE(place(right).x() - place(left).x(), 0.98);
  EXPECT_NEAR(engine->state(left).linear_velocity.x() + engine->state(right).linear_velocity.x(), 0.0, 1e-3);
}

TEST_P(BulletLarge, AColumnStands) {
  add_floor();
  BodyId top{};
  for (int i = 0; i < 10; ++i) top = add_cube({0, 0, 0.5 + i});
  EXPECT_LT(run(4.0), 5e-3);
  EXPECT_LT((place(top) - Vec3(0, 0, 9.5)).norm(), 0.02);
}

// mu 0.5: a = g (sin - mu cos).
TEST_P(BulletLarge, ACubeSlidesByCoulombsLaw) {
  const double angle = 35.0 * std::numbers::pi / 180.0;
  add_floor(angle);
  const Quat turn(Eigen::AngleAxisd(angle, Vec3::UnitY()));
  BodyState state;
  state.orientation = turn;
  state.position = turn * Vec3(0, 0, 0.5);
  const BodyId cube = add({.kind = ShapeKind::box, .half_extents = Vec3::Constant(0.5)}, 1000.0, state);
  run(1.0);
  const double seconds = GetParam().steps(1.0) * GetParam().dt;
  const double expected = test::kG * (std::sin(angle) - 0.5 * std::cos(angle)) * seconds;
  EXPECT_NEAR(engine->state(cube).linear_velocity.norm(), expected, 0.02 * expected);
}

TEST_P(BulletLarge, ABallRolls) {
  add_floor();
  BodyState state;
  state.position = Vec3(0, 0, 0.5);
  state.linear_velocity = Vec3(2, 0, 0);
  state.angular_velocity = Vec3(0, 4, 0);
  const BodyId ball = add({.kind = ShapeKind::sphere, .radius = 0.5}, 500.0, state);
  run(2.0);
  EXPECT_NEAR(engine->state(ball).linear_velocity.x(), 2.0, 0.02);
  EXPECT_NEAR(place(ball).z(), 0.5, 2e-3);
}

TEST_P(BulletLarge, ABallIsStoppedByAThinPlate) {
  add({.kind = ShapeKind::box, .half_extents = {1, 1, 0.005}}, 0.0, {});
  BodyState state;
  state.position = Vec3(0.1, 0, 4);
  state.linear_velocity = Vec3(0, 0, -60);
  const BodyId ball = add({.kind = ShapeKind::sphere, .radius = 0.05}, 1.0, state);
  run(0.16);
  EXPECT_GT(place(ball).z(), 0.05);
}

// Between two searches.
TEST_P(BulletLarge, ABodyThatComesIsMetAtOnce) {
  add_floor();
  const BodyId cube = add_cube({0, 0, 3.0}, {0, 0, -10});
  run(GetParam().dt);
  BodyState state;
  state.position = Vec3(0, 0, 0.6);
  add({.kind = ShapeKind::box, .half_extents = {2, 2, 0.1}}, 0.0, state);
  EXPECT_LT(run(1.0), 5e-3);
  EXPECT_NEAR(place(cube).z(), 1.2, 5e-3);
}

TEST_P(BulletLarge, ABodyThatIsMovedIsMetAtOnce) {
  add_floor();
  const BodyId cube = add_cube({0, 0, 40});
  run(GetParam().dt);
  BodyState state;
  state.position = Vec3(0, 0, 0.51);
  state.linear_velocity = Vec3(0, 0, -10);
  engine->set_state(cube, state);
  run(0.2);
  EXPECT_NEAR(place(cube).z(), 0.5, 2e-3);
}

INSTANTIATE_TEST_SUITE_P(Engines, BulletLarge,
                         testing::Values(test::Tested{"bullet", "large", kCycle_s},
                                         test::Tested{"bullet_float", "large", kCycle_s},
                                         test::Tested{"bullet", "large", 0.25 * kCycle_s},
                                         test::Tested{"bullet_float", "large", 0.25 * kCycle_s}),
                         test::name_of);

}  // namespace
}  // namespace subworld
