// Driven surfaces and pairs of materials against formulas, in the engines that have them.
#include "model/error.hpp"
#include "model/surfaces.hpp"
#include "support/engines.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace subworld {
namespace {

using test::kG;

/// A scene's bodies in one engine, with its pairs of materials.
struct SurfaceBench {
  SurfaceBench(const test::Tested& tested, const std::string& text)
      : scene(load_text("name: bench\n" + text +
                        "users: [{name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, "
                        "position_m: [0, 0, 90], gravity: false}}]\n")),
        dt(tested.dt) {
    EngineSettings settings = tested.settings();
    settings.pairs = scene.settings.world.pairs;
    engine = make_engine(settings, scene.meshes);
    for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
  }
  /// Returns the work of the surfaces, J.
  double run(double seconds) {
    double work_j = 0.0;
    for (long i = std::lround(seconds / dt); i > 0; --i) {
      engine->step(dt);
      work_j += surface_work(scene, engine->contacts());
    }
    return work_j;
  }
  [[nodiscard]] BodyState state(std::uint32_t id) const { return engine->state(BodyId{id}); }

  Scene scene;
  std::unique_ptr<Engine> engine;
  double dt;
};

class Surfaces : public testing::TestWithParam<test::Tested> {};
class TurningFriction : public Surfaces {};

TEST_P(Surfaces, ABeltAcceleratesByFrictionUpToItsSpeed) {
  constexpr double kMu = 0.3, kSpeed_m_s = 1.0, kTime_s = 0.6;
  SurfaceBench bench(GetParam(), R"(
materials: {rubber: {friction: 0.3}}
bodies:
  - {name: belt, shape: box, size_m: [4, 1, 0.1], fixed: true, position_m: [0, 0, -0.05], material: rubber, surface_velocity_m_s: [0.6, 0.8, 0]}
  - {name: box, shape: box, size_m: [0.1, 0.1, 0.02], mass_kg: 2, position_m: [0, 0, 0.01], material: rubber}
)");
  const double work_j = bench.run(kTime_s);
  const double catches_up_s = kSpeed_m_s / (kMu * kG);
  const BodyState end = bench.state(1);
  const Vec3 along(0.6, 0.8, 0);
  EXPECT_NEAR(end.linear_velocity.dot(along), kSpeed_m_s, 2e-3);
  EXPECT_NEAR(end.position.dot(along), kSpeed_m_s * (kTime_s - 0.5 * catches_up_s), 5e-3);
  EXPECT_NEAR(end.position.dot(Vec3(0.8, -0.6, 0)), 0.0, 1e-3);
  EXPECT_NEAR(work_j, kMu * 2.0 * kG * kSpeed_m_s * catches_up_s, 0.02) << "half of it is heat";
}

TEST_P(Surfaces, ABeltMayStandAfterWhatItCarries) {
  SurfaceBench bench(GetParam(), R"(
bodies:
  - {name: box, shape: box, size_m: [0.1, 0.1, 0.02], mass_kg: 2, position_m: [0, 0, 0.01]}
  - {name: belt, shape: box, size_m: [4, 1, 0.1], fixed: true, position_m: [0, 0, -0.05], surface_velocity_m_s: [1, 0, 0]}
)");
  bench.run(0.4);
  EXPECT_NEAR(bench.state(0).linear_velocity.x(), 1.0, 2e-3);
}

TEST_P(Surfaces, ATurntableTakesABoxAround) {
  constexpr double kRate_rad_s = 2.0;
  SurfaceBench bench(GetParam(), R"(
bodies:
  - {name: table, shape: cylinder, radius_m: 0.5, length_m: 0.1, fixed: true, position_m: [0, 0, -0.05], surface_turn_rad_s: [0, 0, 2]}
  - {name: box, shape: box, size_m: [0.1, 0.1, 0.02], mass_kg: 0.5, position_m: [0.2, 0, 0.01], velocity_m_s: [0, 0.4, 0], angular_velocity_rad_s: [0, 0, 2]}
)");
  bench.run(1.0);
  const BodyState end = bench.state(1);
  EXPECT_NEAR(std::atan2(end.position.y(), end.position.x()), kRate_rad_s, 0.02);
  EXPECT_NEAR(end.position.head<2>().norm(), 0.2, 2e-3);
  EXPECT_NEAR(end.angular_velocity.z(), kRate_rad_s, 0.05);
}

TEST_P(Surfaces, ABeltNeitherPushesNorPullsAcross) {
  SurfaceBench bench(GetParam(), R"(
bodies:
  - {name: belt, shape: box, size_m: [1, 1, 1], fixed: true, surface_velocity_m_s: [1, 0, 0]}
  - {name: ball, shape: sphere, radius_m: 0.1, mass_kg: 1, position_m: [0.6, 0, 0], gravity: false}
)");
  bench.run(0.2);
  EXPECT_LT((bench.state(1).position - Vec3(0.6, 0, 0)).norm(), 1e-4);
}

// A board on a slope of 30 degrees, and a ball that falls on a floor.
TEST_P(Surfaces, APairOfMaterialsHasItsOwnFrictionAndRestitution) {
  const std::string bodies = R"(
bodies:
  - {name: slope, shape: plane, fixed: true, rotation: {axis: [0, 1, 0], angle_deg: 30}, material: steel}
  - {name: board, shape: box, size_m: [0.2, 0.2, 0.02], mass_kg: 1, position_m: [0.005, 0, 0.00866], rotation: {axis: [0, 1, 0], angle_deg: 30}, material: ice}
  - {name: table, shape: compound, position_m: [0.35141, 2, -0.19134], rotation: {axis: [0, 1, 0], angle_deg: 30}, material: ice,
     parts: [{shape: box, size_m: [0.2, 0.2, 0.02], mass_kg: 1}, {shape: box, size_m: [0.1, 0.1, 0.02], mass_kg: 1, position_m: [0, 0, 0.02]}]}
  - {name: floor, shape: box, size_m: [1, 1, 1], fixed: true, position_m: [9, 0, 9], material: steel}
  - {name: ball, shape: sphere, radius_m: 0.05, mass_kg: 1, position_m: [9, 0, 9.75], material: glass}
)";
  const std::string materials =
      "materials: {steel: {friction: 0.9}, ice: {friction: 0.9}, glass: {friction: 0, restitution: 0}}\n";
  constexpr double kMu = 0.1, kTime_s = 0.4, kFall_m = 0.2, kRestitution = 0.8;
  SurfaceBench usual(GetParam(), materials + bodies), pairs(GetParam(), materials + R"(
pairs:
  - {a: ice, b: steel, friction: 0.1}
  - {a: steel, b: glass, restitution: 0.8}
)" + bodies);
  const Vec3 board = usual.state(1).position, table = usual.state(2).position;
  usual.run(kTime_s);
  EXPECT_LT((usual.state(1).position - board).norm(), 2e-3);
  pairs.run(kTime_s);
  const double way_m = 0.5 * kG * (0.5 - kMu * std::sqrt(0.75)) * kTime_s * kTime_s;
  EXPECT_NEAR((pairs.state(1).position - board).norm(), way_m, 0.02 * way_m);
  EXPECT_NEAR((pairs.state(2).position - table).norm(), way_m, 0.03 * way_m);
  // The ball meets the floor after 0.202 s and is near the top of its bounce 0.16 s later.
  const double up_m_s = kRestitution * std::sqrt(2.0 * kG * kFall_m), later_s = kTime_s - std::sqrt(2.0 * kFall_m / kG);
  EXPECT_NEAR(pairs.state(4).position.z() - 9.55, up_m_s * later_s - 0.5 * kG * later_s * later_s, 5e-3);
  EXPECT_NEAR(usual.state(4).position.z() - 9.55, 0.0, 2e-3);
}

TEST_P(TurningFriction, RollingFrictionStopsABallAndSpinningFrictionATop) {
  constexpr double kRolling_m = 2e-3, kSpinning_m = 1e-3, kRadius_m = 0.05, kSpeed_m_s = 0.5, kTime_s = 0.5;
  SurfaceBench bench(GetParam(), R"(
materials: {felt: {rolling_friction_m: 0.0015}, ivory: {rolling_friction_m: 0.0005, spinning_friction_m: 0.001}}
bodies:
  - {name: floor, shape: plane, fixed: true, material: felt}
  - {name: ball, shape: sphere, radius_m: 0.05, mass_kg: 0.2, material: ivory, position_m: [0, 0, 0.05], velocity_m_s: [0.3, 0.4, 0], angular_velocity_rad_s: [-8, 6, 0]}
  - {name: top, shape: sphere, radius_m: 0.05, mass_kg: 0.2, material: ivory, position_m: [0, 1, 0.05], angular_velocity_rad_s: [0, 0, 10]}
  - {name: slope, shape: box, size_m: [9, 1, 1], fixed: true, material: felt, position_m: [0, 5, 0], rotation: {axis: [0, 1, 0], angle_deg: 2}}
  - {name: held, shape: sphere, radius_m: 0.05, mass_kg: 0.2, material: ivory, position_m: [0.019195, 5, 0.549665]}
)");
  bench.run(kTime_s);
  const BodyState ball = bench.state(1), top = bench.state(2), held = bench.state(4);
  const double braking_m_s2 = 5.0 / 7.0 * kG * kRolling_m / kRadius_m;
  EXPECT_NEAR(ball.linear_velocity.norm(), kSpeed_m_s - braking_m_s2 * kTime_s, 5e-3);
  EXPECT_NEAR(ball.position.dot(Vec3(0.6, 0.8, 0)), kTime_s * (kSpeed_m_s - 0.5 * braking_m_s2 * kTime_s), 5e-3);
  EXPECT_NEAR(top.angular_velocity.z(), 10.0 - kSpinning_m * kG / (0.4 * kRadius_m * kRadius_m) * kTime_s, 0.1);
  EXPECT_LT(held.linear_velocity.norm(), 1e-4) << "tan 2 deg is less than the length over the radius";
  bench.run(2.0);
  EXPECT_LT(bench.state(1).linear_velocity.norm(), 1e-3);
  EXPECT_LT(bench.state(2).angular_velocity.norm(), 0.02);
}

TEST_P(TurningFriction, ATurntableSpinsATopUp) {
  SurfaceBench bench(GetParam(), R"(
materials: {felt: {spinning_friction_m: 0.002}}
bodies:
  - {name: table, shape: box, size_m: [1, 1, 0.1], fixed: true, position_m: [0, 0, -0.05], material: felt, surface_turn_rad_s: [0, 0, 3]}
  - {name: top, shape: sphere, radius_m: 0.05, mass_kg: 0.2, position_m: [0, 0, 0.05]}
)");
  bench.run(1.0);
  EXPECT_NEAR(bench.state(1).angular_velocity.z(), 3.0, 0.02);
}

std::vector<test::Tested> engines_at_1_ms(std::initializer_list<std::string_view> names) {
  return test::only(names, test::tested_engines({0.001}, {0.001}));
}
INSTANTIATE_TEST_SUITE_P(Engines, Surfaces, testing::ValuesIn(engines_at_1_ms({"bullet", "bullet_float", "ode"})),
                         test::name_of);
INSTANTIATE_TEST_SUITE_P(Engines, TurningFriction, testing::ValuesIn(engines_at_1_ms({"bullet", "bullet_float"})),
                         test::name_of);

TEST(SurfacesOfModules, OtherEnginesRefuseThem) {
  for (const test::Tested& tested : test::tested_engines({0.001}, {})) {
    if (tested.engine.starts_with("bullet")) continue;
    Body ball = test::cube(BodyId{0});
    ball.material.rolling_friction = 1e-3;
    EXPECT_THROW(tested.make()->add(ball, {}), Error) << tested.engine;
    if (tested.engine == "ode") continue;
    Body belt = test::floor_plane(BodyId{0});
    belt.surface_velocity = Vec3::UnitX();
    EXPECT_THROW(tested.make()->add(belt, {}), Error) << tested.engine;
    EngineSettings settings = tested.settings();
    settings.pairs.push_back({1, 2, 0.5, {}});
    EXPECT_THROW((void)make_engine(settings, {}), Error) << tested.engine;
  }
}

}  // namespace
}  // namespace subworld
