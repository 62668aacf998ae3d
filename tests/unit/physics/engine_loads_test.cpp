// Duties of an adapter that stores data besides its engine's: changing loads, orders, fast bodies.

#include "physics/plugin.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace subworld {
namespace {

using test::at;
using test::cube;
using test::floor_plane;
using test::kCube;
using test::kCubeWeight_n;
using test::kFloor;
using test::kG;

class Loads : public testing::TestWithParam<test::Tested> {
 protected:
  static constexpr auto kStill = [](Engine&) {};
  template <class Each>
  void run(Engine& moved, double seconds, const Each& each) {
    for (int i = 0; i < GetParam().steps(seconds); ++i) {
      each(moved);
      moved.step(dt);
    }
  }
  static Vec3 friction_on_cube(std::span<const Contact> contacts) {
    Vec3 sum = Vec3::Zero();
    for (const Contact& c : contacts) sum += (c.a == kCube ? 1.0 : -1.0) * c.tangential_impulse;
    return sum;
  }

  double dt = GetParam().dt;
  std::unique_ptr<Engine> engine = GetParam().make();
};

TEST_P(Loads, ContactsNameTheLowerIdFirstWhicheverWasAddedFirst) {
  engine->add(cube(kCube), at(0, 0, 0.05));
  engine->add(floor_plane(kFloor), BodyState{});
  run(*engine, 0.5, [](Engine& e) { e.apply_force(kCube, {0.3 * kCubeWeight_n, 0, 0}, Vec3::Zero()); });
  EXPECT_LE(friction_on_cube(engine->contacts()).x(), 0.0) << "also where it is not asked for";
  const auto contacts = engine->contacts_with_friction();
  ASSERT_FALSE(contacts.empty());
  for (const Contact& c : contacts) {
    EXPECT_EQ(c.a, kFloor);
    EXPECT_EQ(c.b, kCube);
    EXPECT_NEAR(c.normal.z(), -1.0, 1e-3);
    EXPECT_NEAR(c.point.z(), 0.0, 1e-3);
  }
  EXPECT_NEAR(friction_on_cube(contacts).x(), -0.3 * kCubeWeight_n * dt, 0.1 * kCubeWeight_n * dt);
}

/// If friction is estimated, contacts() may have none, or about the estimate.
TEST_P(Loads, FrictionThatIsThereWithoutAskingIsAboutRight) {
  engine->add(floor_plane(kFloor), BodyState{});
  engine->add(cube(kCube), at(0, 0, 0.05));
  for (int i = 0; i < GetParam().steps(0.5); ++i) {
    engine->apply_force(kCube, {2.0 * 0.5 * kCubeWeight_n, 0, 0}, Vec3::Zero());
    engine->step(dt);
  }
  const Vec3 there = friction_on_cube(engine->contacts());
  const Vec3 asked = friction_on_cube(engine->contacts_with_friction());
  if (!there.isZero(0.0)) {
    EXPECT_LT((there - asked).norm(), 0.2 * asked.norm());
  }
}

TEST_P(Loads, ATorqueAloneTurnsAndEnds) {
  Body free = cube(kCube);
  free.gravity = false;
  engine->add(free, at(0, 0, 1));
  const double torque = 1e-4, inertia = free.inertia.z();
  run(*engine, 0.1, kStill);
  run(*engine, 0.1, [&](Engine& e) { e.apply_force(kCube, Vec3::Zero(), {0, 0, torque}); });
  const double expected = torque * dt * GetParam().steps(0.1) / inertia;
  EXPECT_NEAR(engine->state(kCube).angular_velocity.z(), expected, 1e-3 * expected);
  run(*engine, 0.1, kStill);
  EXPECT_NEAR(engine->state(kCube).angular_velocity.z(), expected, 1e-3 * expected);
}

class ExactCheckpoints : public Loads {};

TEST_P(ExactCheckpoints, DoNotBringLoadsOfBeforeBack) {
  engine->add(floor_plane(kFloor), BodyState{});
  engine->add(cube(kCube), at(0, 0, 0.05));
  run(*engine, 0.5, kStill);
  run(*engine, 0.1, [](Engine& e) { e.apply_force(kCube, {0.8 * kCubeWeight_n, 0, 0}, Vec3::Zero()); });
  const Checkpoint moving = engine->checkpoint();
  run(*engine, 0.1, kStill);
  const std::vector<double> once = test::bits(*engine, {kCube});
  engine->restore(moving);
  run(*engine, 0.1, kStill);
  EXPECT_EQ(test::bits(*engine, {kCube}), once);
}

TEST_P(Loads, AFastBodyStaysFast) {
  Body shot = cube(kCube);
  shot.gravity = false;
  BodyState start = at(0, 0, 1);
  start.linear_velocity = {600, 0, 0};
  engine->add(shot, start);
  engine->step(dt);
  EXPECT_NEAR(engine->state(kCube).linear_velocity.x(), 600.0, 0.1);
  EXPECT_NEAR(engine->state(kCube).position.x(), 600.0 * dt, 0.01 * 600.0 * dt);
}

std::vector<test::Tested> with_exact_checkpoints() {
  std::vector<test::Tested> all = test::tested_engines({0.001, 0.004}, {0.001});
  std::erase_if(all, [](const test::Tested& t) { return t.make()->capabilities().checkpoint != Fidelity::exact; });
  return all;
}

INSTANTIATE_TEST_SUITE_P(Engines, ExactCheckpoints, testing::ValuesIn(with_exact_checkpoints()), test::name_of);
INSTANTIATE_TEST_SUITE_P(Engines, Loads, testing::ValuesIn(test::tested_engines({0.001, 0.004}, {0.001})),
                         test::name_of);

class LookingAhead : public testing::TestWithParam<test::Tested> {};

// If an engine claims it, a ball of 5 mm does not pass through a plate of 10 mm, movable or not.
TEST_P(LookingAhead, AShotMeetsAPlate) {
  const double dt = GetParam().dt;
  for (const double speed : {2.0, 5.0, 10.0, 30.0, 100.0}) {
    for (const double plate_kg : {0.0, 5.0}) {
      SCOPED_TRACE(testing::Message() << speed << " m/s, plate of " << plate_kg << " kg");
      const auto range = GetParam().make();
      Body plate = cube(kFloor, 0.4, plate_kg);
      plate.shape.half_extents = {0.005, 0.2, 0.2};
      plate.gravity = false;
      BodyState start = at(-0.1033, 0, 0);
      start.linear_velocity = {speed, 0, 0};
      range->add(plate, BodyState{});
      range->add(test::ball_proxy(kCube, 0.0025, 1e-3), start);
      test::run(*range, static_cast<int>(0.2 / dt), dt);
      EXPECT_LT(range->state(kCube).position.x(), range->state(kFloor).position.x());
      if (plate_kg == 0.0) continue;
      // Only the ball's momentum moves it.
      const double expected = 1e-3 * speed / (plate_kg + 1e-3);
      EXPECT_NEAR(range->state(kFloor).linear_velocity.x(), expected, 0.02 * expected);
    }
  }
}

std::vector<test::Tested> that_look_ahead() {
  std::vector<test::Tested> all = test::tested_engines({0.001, 0.004}, {0.001, 0.004});
  std::erase_if(all, [](const test::Tested& t) { return !engine_plugin(t.engine).limits.continuous; });
  return all;
}

INSTANTIATE_TEST_SUITE_P(Engines, LookingAhead, testing::ValuesIn(that_look_ahead()), test::name_of);

}  // namespace
}  // namespace subworld
