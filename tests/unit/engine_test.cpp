#include "physics/engine.hpp"

#include "model/error.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace subworld {
namespace {

using test::at;
using test::cube;
using test::floor_plane;

constexpr double kG = 9.81;

EngineSettings settings(const std::string& engine, const std::string& preset) {
  EngineSettings s;
  s.name = engine;
  s.preset = preset;
  return s;
}

struct Totals {
  double normal = 0.0;
  Vec3 tangential = Vec3::Zero();
};

/// On the movable body `id`.
Totals totals(const Engine& engine, BodyId id) {
  Totals sum;
  for (const Contact& c : engine.contacts()) {
    if (c.a != id && c.b != id) continue;
    sum.normal += c.normal_impulse;
    sum.tangential += (c.a == id ? 1.0 : -1.0) * c.tangential_impulse;
  }
  return sum;
}

class EngineTest : public testing::TestWithParam<std::tuple<std::string, std::string, double>> {
 protected:
  EngineTest()
      : dt(std::get<2>(GetParam())),
        engine(make_engine(settings(std::get<0>(GetParam()), std::get<1>(GetParam())), {})) {
    engine->add(floor_plane(BodyId{0}), BodyState{});
    engine->add(cube(BodyId{1}), at(0, 0, 0.05));
  }
  /// Relative; engines other than Bullet calculate in single precision.
  double precision() const { return engine->name() == "bullet" ? 1e-12 : 1e-6; }
  void settle(double seconds) {
    for (double t = 0.0; t < seconds; t += dt) engine->step(dt);
  }
  double dt;
  std::unique_ptr<Engine> engine;
};

TEST_P(EngineTest, ContactImpulsesCarryTheWeight) {
  settle(1.0);
  double normal = 0.0;
  constexpr int kSteps = 20;
  for (int i = 0; i < kSteps; ++i) {
    engine->step(dt);
    normal += totals(*engine, BodyId{1}).normal;
  }
  EXPECT_NEAR(normal, 0.2 * kG * dt * kSteps, 0.02 * 0.2 * kG * dt * kSteps);
}

TEST_P(EngineTest, FrictionCarriesAForceBelowTheCone) {
  const bool tells = engine->capabilities().tangential_impulse != Fidelity::absent;
  settle(1.0);
  const double pull = 0.4 * 0.5 * 0.2 * kG;  // 40 % of mu m g
  Vec3 friction = Vec3::Zero();
  const int steps = static_cast<int>(std::lround(0.5 / dt));
  const Vec3 before = engine->state(BodyId{1}).position;
  for (int i = 0; i < 2 * steps; ++i) {
    engine->apply_force(BodyId{1}, {pull, 0, 0}, Vec3::Zero());
    engine->step(dt);
    if (i >= steps) friction += totals(*engine, BodyId{1}).tangential;
  }
  if (tells) {
    EXPECT_NEAR(friction.x(), -pull * dt * steps, 0.05 * pull * dt * steps);
  }
  EXPECT_LT((engine->state(BodyId{1}).position - before).head<2>().norm(), 1e-3);
}

TEST_P(EngineTest, SlidingFrictionIsMuTimesNormal) {
  settle(1.0);
  double friction = 0.0, normal = 0.0;
  for (double t = 0.0; t < 0.3; t += dt) {
    engine->apply_force(BodyId{1}, {2.0 * 0.5 * 0.2 * kG, 0, 0}, Vec3::Zero());
    engine->step(dt);
    friction += totals(*engine, BodyId{1}).tangential.x();
    normal += totals(*engine, BodyId{1}).normal;
  }
  EXPECT_GT(engine->state(BodyId{1}).linear_velocity.x(), 0.5);
  if (engine->capabilities().tangential_impulse == Fidelity::absent) {
    friction = 0.2 * engine->state(BodyId{1}).linear_velocity.x() - 2.0 * 0.5 * 0.2 * kG * 0.3;  // what slowed it
  }
  EXPECT_NEAR(-friction / normal, 0.5, 0.025);
}

TEST_P(EngineTest, ImpulseChangesVelocityAtOnce) {
  BodyState up = at(0, 0, 5);
  ASSERT_TRUE(engine->set_state(BodyId{1}, up));
  ASSERT_TRUE(engine->apply_impulse(BodyId{1}, {0, 0.2, 0}, {0.05, 0, 5}));
  const BodyState s = engine->state(BodyId{1});
  EXPECT_NEAR(s.linear_velocity.y(), 1.0, precision());
  const double inertia = 0.2 * 0.01 / 6.0;
  EXPECT_NEAR(s.angular_velocity.z(), 0.05 * 0.2 / inertia, 1e3 * precision());
}

TEST_P(EngineTest, ForceActsForOneStepOnly) {
  ASSERT_TRUE(engine->set_state(BodyId{1}, at(0, 0, 5)));
  engine->apply_force(BodyId{1}, {1, 0, 0}, Vec3::Zero());
  engine->step(dt);
  const double v = engine->state(BodyId{1}).linear_velocity.x();
  EXPECT_NEAR(v, dt / 0.2, precision());
  engine->step(dt);
  EXPECT_NEAR(engine->state(BodyId{1}).linear_velocity.x(), v, precision());
}

TEST_P(EngineTest, InertiaLeavesTheWeightAlone) {
  ASSERT_TRUE(engine->set_state(BodyId{1}, at(0, 0, 5)));
  engine->set_inertia(BodyId{1}, 0.4, Vec3::Constant(0.01));
  engine->step(dt);
  EXPECT_NEAR(engine->state(BodyId{1}).linear_velocity.z(), -0.5 * kG * dt,
              1e3 * precision() * kG * dt);  // weight 0.2 g on 0.4 kg
}

TEST_P(EngineTest, OverlapUsesTheBodysOwnBounds) {
  engine->add(cube(BodyId{2}), at(0.3, 0, 0.05));
  std::vector<BodyId> found;
  engine->overlap({Vec3(0.06, -0.1, 0.01), Vec3(0.24, 0.1, 0.1)}, found);
  EXPECT_EQ(found, std::vector{BodyId{0}});  // a plane is everywhere
  engine->overlap({Vec3(0.06, -0.1, -0.01), Vec3(0.26, 0.1, 0.1)}, found);
  EXPECT_EQ(found, (std::vector{BodyId{0}, BodyId{2}}));
}

TEST_P(EngineTest, RefusesWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BodyState bad = at(0, 0, nan);
  const BodyState before = engine->state(BodyId{1});
  EXPECT_FALSE(engine->set_state(BodyId{1}, bad));
  EXPECT_FALSE(engine->apply_impulse(BodyId{1}, {nan, 0, 0}, Vec3::Zero()));
  EXPECT_FALSE(engine->apply_force(BodyId{1}, {0, INFINITY, 0}, Vec3::Zero()));
  EXPECT_EQ(engine->state(BodyId{1}).position, before.position);
  EXPECT_THROW(engine->add(cube(BodyId{7}), bad), Error);
  EXPECT_THROW(engine->add(cube(BodyId{1}), before), Error);
  EXPECT_THROW((void)engine->state(BodyId{9}), Error);
}

TEST_P(EngineTest, AddsAndRemovesWithoutTrace) {
  for (int i = 0; i < 2000; ++i) {
    engine->add(cube(BodyId{2}), at(0.05, 0, 0.15));
    engine->step(dt);
    engine->remove(BodyId{2});
  }
  EXPECT_FALSE(engine->contains(BodyId{2}));
  engine->step(dt);
  for (const Contact& c : engine->contacts()) EXPECT_NE(c.b, BodyId{2});
}

TEST_P(EngineTest, CheckpointTakesBodiesBack) {
  settle(0.2);
  const Checkpoint saved = engine->checkpoint();
  const BodyState before = engine->state(BodyId{1});
  engine->apply_impulse(BodyId{1}, {0.1, 0, 0.3}, {0, 0, 0.05});
  settle(0.1);
  ASSERT_GT((engine->state(BodyId{1}).position - before.position).norm(), 0.01);
  engine->restore(saved);
  EXPECT_EQ(engine->state(BodyId{1}).position, before.position);
  EXPECT_EQ(engine->state(BodyId{1}).linear_velocity, before.linear_velocity);
  engine->add(cube(BodyId{2}), at(1, 0, 0.05));
  EXPECT_THROW(engine->restore(saved), Error);
}

TEST_P(EngineTest, GhostsMeetMovableBodiesOnly) {
  settle(0.2);
  engine->add(cube(BodyId{2}), at(0, 0, 0.145), Role::ghost);  // 5 mm deep in the cube
  engine->add(cube(BodyId{3}), at(1, 0, 0.02), Role::ghost);   // in the floor
  engine->add(cube(BodyId{4}), at(1, 0, 0.03), Role::ghost);   // in the other ghost
  engine->step(dt);
  bool met = false;
  for (const Contact& c : engine->contacts()) {
    EXPECT_LT(index(c.b), 3U);
    EXPECT_FALSE(c.a == BodyId{0} && c.b == BodyId{2});
    met = met || (c.a == BodyId{1} && c.b == BodyId{2});
  }
  EXPECT_TRUE(met);
}

TEST_P(EngineTest, ExactCheckpointsContinueBitByBit) {
  if (engine->capabilities().checkpoint != Fidelity::exact) GTEST_SKIP() << "the engine does not promise it";
  for (unsigned i = 2; i < 12; ++i) engine->add(cube(BodyId{i}), at(0.013 * i, 0.02 * (i % 3), 0.05 + 0.11 * i));
  settle(0.3);
  const Checkpoint saved = engine->checkpoint();
  settle(0.2);
  const BodyState first = engine->state(BodyId{7});
  engine->restore(saved);
  settle(0.2);
  EXPECT_EQ(engine->state(BodyId{7}).position, first.position);
  EXPECT_EQ(engine->state(BodyId{7}).angular_velocity, first.angular_velocity);
}

TEST_P(EngineTest, EveryShapeRestsOnTheFloor) {
  Body round = cube(BodyId{2});
  round.shape.kind = ShapeKind::sphere;
  round.shape.radius = 0.05;
  engine->add(round, at(0.3, 0, 0.05));
  for (const ShapeKind kind : {ShapeKind::capsule, ShapeKind::cylinder}) {
    Body body = cube(BodyId{kind == ShapeKind::capsule ? 3U : 4U});
    body.shape.kind = kind;
    body.shape.radius = 0.03;
    body.shape.half_length = kind == ShapeKind::capsule ? 0.02 : 0.05;
    engine->add(body, at(0.3 * index(body.id), 0, 0.05));
  }
  settle(0.2);
  for (unsigned i = 1; i < 5; ++i) EXPECT_NEAR(engine->state(BodyId{i}).position.z(), 0.05, 0.003) << i;
}

TEST_P(EngineTest, EqualRunsGiveEqualBits) {
  const auto run = [&] {
    auto e = make_engine(settings(std::get<0>(GetParam()), std::get<1>(GetParam())), {});
    e->add(floor_plane(BodyId{0}), BodyState{});
    for (unsigned i = 1; i < 20; ++i) e->add(cube(BodyId{i}), at(0.013 * i, 0.021 * (i % 3), 0.06 + 0.11 * i));
    for (int i = 0; i < 300; ++i) e->step(dt);
    std::vector<double> bits;
    for (unsigned i = 1; i < 20; ++i) {
      const BodyState s = e->state(BodyId{i});
      bits.insert(bits.end(),
                  {s.position.x(), s.position.y(), s.position.z(), s.orientation.w(), s.angular_velocity.x()});
    }
    return bits;
  };
  EXPECT_EQ(run(), run());
}

std::string test_name(const testing::TestParamInfo<EngineTest::ParamType>& tested) {
  return std::get<1>(tested.param) + "_" + std::to_string(static_cast<int>(1e6 * std::get<2>(tested.param))) + "us";
}

INSTANTIATE_TEST_SUITE_P(Bullet, EngineTest,
                         testing::Values(std::tuple{"bullet", "fast", 0.001}, std::tuple{"bullet", "fast", 0.004},
                                         std::tuple{"bullet", "quality", 0.001},
                                         std::tuple{"bullet", "quality", 1.0 / 60.0}),
                         test_name);

#ifdef SUBWORLD_HAVOK
INSTANTIATE_TEST_SUITE_P(Havok, EngineTest,
                         testing::Values(std::tuple{"havok", "fast", 0.001}, std::tuple{"havok", "fast", 0.004},
                                         std::tuple{"havok", "quality", 0.004}),
                         test_name);
#endif

#ifdef SUBWORLD_PHYSX
INSTANTIATE_TEST_SUITE_P(Physx, EngineTest,
                         testing::Values(std::tuple{"physx", "fast", 0.001}, std::tuple{"physx", "fast", 0.004},
                                         std::tuple{"physx", "quality", 0.004}),
                         test_name);
#endif

TEST(Engines, UnknownNamesAreErrorsThatNameTheCure) {
  try {
    (void)make_engine(settings("havoc", "fast"), {});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::usage);
    EXPECT_NE(std::string(e.what()).find("bullet"), std::string::npos);
  }
  EXPECT_THROW((void)make_engine(settings("bullet", "best"), {}), Error);
}

}  // namespace
}  // namespace subworld
