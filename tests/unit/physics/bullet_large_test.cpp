// Bullet's preset large: contacts that are found ahead and hold for several steps.

#include "model/shapes/mass_properties.hpp"
#include "physics/shells/live_engine.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

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

// A force and a mass of each part of the step: v = h sum (F - m0 g) / m.
TEST_P(BulletLarge, ADrivenBodyFollowsTheForcesOfAllParts) {
  BodyState state;
  state.position = Vec3(0, 0, 50);
  const BodyId ball = add({.kind = ShapeKind::sphere, .radius = 0.5}, 10.0, state);
  double expected = 0.0, seen = 0.0, after_s = 0.0;
  int parts = 0;
  for (int step = 0; step < 3; ++step) {
    double until_now_s = 0.0;
    engine->step_driven(GetParam().dt, {&ball, 1}, [&](double until_s, double h) {
      EXPECT_NEAR(until_s, until_now_s + h, 1e-9);
      until_now_s = until_s;
      seen = std::max(seen, std::abs(engine->state(ball).linear_velocity.z() - expected));
      const double mass = 10.0 + parts, force = 20.0 * parts;
      engine->set_inertia(ball, mass, Vec3::Constant(0.1 * mass));
      engine->apply_force(ball, {0, 0, force}, Vec3::Zero());
      expected += h * (force - 10.0 * test::kG) / mass;
      ++parts;
    });
    EXPECT_NEAR(until_now_s, GetParam().dt, 1e-9);
    after_s += GetParam().dt;
  }
  EXPECT_NEAR(parts, after_s / 2e-3, 0.01) << "small steps of 2 ms";
  EXPECT_LT(seen, 1e-5);
  EXPECT_NEAR(engine->state(ball).linear_velocity.z(), expected, 1e-5);
}

// It becomes a hundred times as heavy before the small step whose end stops it: half of the speed is left to the next.
TEST_P(BulletLarge, ADrivenBodyHitsWithTheMassThatItHas) {
  const BodyId cube = add_cube({0, 0, 50});
  const double dt = GetParam().dt, speed_m_s = 10.0;
  BodyState state;
  state.position = Vec3(-1.0 - speed_m_s * (dt + 1e-3), 0, 50);
  state.linear_velocity.x() = speed_m_s;
  const BodyId ball = add({.kind = ShapeKind::sphere, .radius = 0.5}, 10.0, state);
  engine->step_driven(dt, {&ball, 1}, [&](double until_s, double) {
    if (until_s > dt - 1e-6) engine->set_inertia(ball, 1000.0, Vec3::Constant(100.0));
  });
  run(0.1);
  for (const BodyId id : {cube, ball}) EXPECT_NEAR(engine->state(id).linear_velocity.x(), 0.5 * speed_m_s, 0.1);
}

// Its spin changes by itself within a step, so that it is driven between sub-steps of at most 5 ms.
TEST_P(BulletLarge, ADrivenBodyThatTumblesFollowsTheForcesOfAllSubSteps) {
  BodyState state;
  state.position = Vec3(0, 0, 50);
  const BodyId plate = add({.kind = ShapeKind::box, .half_extents = {0.5, 0.3, 0.1}}, 10.0, state);
  const double dt = GetParam().dt;
  double expected = 0.0, until_now_s = 0.0;
  int parts = 0;
  engine->step_driven(dt, {&plate, 1}, [&](double until_s, double h) {
    EXPECT_NEAR(until_s, until_now_s + h, 1e-9);
    until_now_s = until_s;
    const double force = 100.0 * ++parts;
    engine->apply_force(plate, {0, 0, force}, Vec3::Zero());
    expected += h * (force / 10.0 - test::kG);
  });
  EXPECT_EQ(parts, dt > 5e-3 ? 4 : 1);
  EXPECT_NEAR(until_now_s, dt, 1e-9);
  EXPECT_NEAR(engine->state(plate).linear_velocity.z(), expected, 1e-5);
}

// An engine that takes over is warmed up with the loads of the last part, not with their sum.
TEST_P(BulletLarge, AnEngineThatIsReplacedKnowsTheLoadOfTheLastPart) {
  LiveEngine live(std::move(engine));
  Body ball;
  ball.shape = {.kind = ShapeKind::sphere, .radius = 0.5};
  ball.mass = 10.0;
  ball.inertia = principal_inertia(ball.shape, ball.mass);
  live.add(ball, {}, Role::body);
  live.step_driven(GetParam().dt, {&ball.id, 1}, [&](double, double) {
    live.apply_force(ball.id, {0, 0, 30}, Vec3::Zero());
  });
  ASSERT_EQ(live.content().size(), 1U);
  EXPECT_EQ(live.content()[0].load.force.z(), 30.0);
}

TEST_P(BulletLarge, NoResultDependsOnTheNumberOfThreads) {
  const auto after = [](int threads) {
    EngineSettings settings = GetParam().settings();
    settings.threads = threads;
    const auto world = make_engine(settings, {});
    std::uint32_t bodies = 0;
    const auto put = [&](const Shape& shape, double mass, const Vec3& position) {
      Body body;
      body.id = BodyId{bodies++};
      body.shape = shape;
      body.mass = mass;
      if (mass > 0.0) body.inertia = principal_inertia(shape, mass);
      BodyState state;
      state.position = position;
      world->add(body, state);
    };
    put({.kind = ShapeKind::plane}, 0.0, Vec3::Zero());
    put({.kind = ShapeKind::box, .half_extents = {0.2, 4, 1}}, 0.0, {-4, 0, 1});
    for (int i = 0; i < 500; ++i) {
      const Vec3 position(i % 10 * 0.6 + 0.1 * (i / 100 % 2), i / 10 % 10 * 0.6, 0.5 + i / 100 * 0.6);
      if (i % 3 == 0) {
        put({.kind = ShapeKind::sphere, .radius = 0.25}, 60.0, position);
      } else {
        put({.kind = ShapeKind::box, .half_extents = Vec3(0.25, 0.25, 0.2 + 0.05 * (i % 2))}, 100.0, position);
      }
    }
    for (int i = 0; i < GetParam().steps(0.6); ++i) world->step(GetParam().dt);
    std::vector<double> all;
    for (std::uint32_t id = 0; id < bodies; ++id) {
      const BodyState state = world->state(BodyId{id});
      for (const Vec3& v : {state.position, state.linear_velocity, state.angular_velocity})
        all.insert(all.end(), v.begin(), v.end());
    }
    for (const Contact& contact : world->contacts())
      all.insert(all.end(), {contact.distance, contact.normal_impulse, contact.tangential_impulse.x()});
    return all;
  };
  const std::vector<double> alone = after(1);
  for (const int threads : {2, 3, 4}) EXPECT_EQ(after(threads), alone) << threads << " threads";
}

INSTANTIATE_TEST_SUITE_P(Engines, BulletLarge,
                         testing::Values(test::Tested{"bullet", "large", kCycle_s},
                                         test::Tested{"bullet_float", "large", kCycle_s},
                                         test::Tested{"bullet", "large", 0.25 * kCycle_s},
                                         test::Tested{"bullet_float", "large", 0.25 * kCycle_s}),
                         test::name_of);

}  // namespace
}  // namespace subworld
