// Mechanisms and assemblies in the coupling: felt forces against formulas and against the same scene in one world.
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace subworld {
namespace {

constexpr double kG = 9.81;

Scene shipped(const std::string& name, int ratio, double latency_s = 0.0, const char* scheme = "reduced") {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.users = static_cast<int>(scene.users.size());
  scene.settings.scheme = scheme;
  scene.settings.set_ratio({ratio, ratio});
  scene.settings.delay.up_s = scene.settings.delay.down_s = 0.5 * latency_s;
  return scene;
}

/// Mean force on the operator, N, between two times.
Vec3 mean_force(const CoupledRun& run, double from_s, double to_s) {
  Vec3 sum = Vec3::Zero();
  std::size_t count = 0;
  const auto& felt = run.felt[0].on_operator;
  for (auto i = static_cast<std::size_t>(from_s * 1e3); i < static_cast<std::size_t>(to_s * 1e3); ++i, ++count)
    sum += felt[i];
  return sum / static_cast<double>(count);
}

TEST(Mechanism, IsFeltAsInOneWorldAtAnyRatio) {
  for (const char* name : {"drawer", "door", "crank", "chain"}) {
    CoupledRun reference(shipped(name, 1, 0.0, "direct"));
    ASSERT_TRUE(reference.run()) << name;
    for (const int ratio : {4, 20}) {
      CoupledRun coupled(shipped(name, ratio));
      ASSERT_TRUE(coupled.run()) << name;
      EXPECT_LT(force_error(coupled.felt[0].force, reference.felt[0].force, 1e-3).rms, 2e-3) << name << " r " << ratio;
    }
  }
}

TEST(Mechanism, ADrawerIsHeldByTheFrictionOfItsRails) {
  CoupledRun run(shipped("drawer", 10));
  ASSERT_TRUE(run.run());
  // At 2.2 s of the second pull the speed is greatest: no acceleration. The coupling adds its lag of one step.
  EXPECT_NEAR(mean_force(run, 2.08, 2.12).x(), 2.0, 0.15);
}

TEST(Mechanism, AConveyorPushesWithItsFriction) {
  CoupledRun reference(shipped("conveyor", 1, 0.0, "direct"));
  ASSERT_TRUE(reference.run());
  for (const int ratio : {4, 20}) {
    CoupledRun run(shipped("conveyor", ratio));
    ASSERT_TRUE(run.run());
    EXPECT_NEAR(mean_force(run, 2.8, 3.1).x(), 0.4 * 3 * 0.4 * kG, 0.1) << "of three parcels";
    EXPECT_LT(run.world.facts().energy_excess_j, 5e-3) << "the belt works";
    EXPECT_LT(run.guards[0]->port().created_j(), 1e-3);
    EXPECT_LT(force_error(run.felt[0].force, reference.felt[0].force, 1e-3).rms, 0.035) << ratio;
  }
}

TEST(Mechanism, ALeverDividesTheWeight) {
  CoupledRun run(shipped("lever", 10));
  ASSERT_TRUE(run.run());
  // About the pivot: 1 kg at 0.1 m against 0.4 kg at 0.15 m and the operator at 0.4 m.
  EXPECT_NEAR(mean_force(run, 2.9, 3.0).z(), (1.0 * 0.1 - 0.4 * 0.15) * kG / 0.4, 0.15);
}

TEST(Mechanism, ALidIsHeldByTheRuleOfTheLever) {
  Scene scene = shipped("box_with_lid", 10);
  scene.settings.duration_s = 1.0;
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  // The tool, without friction, is 8 mm + 3 mm below the lid's middle plane, in which the hinge is.
  const Vec3 tool = run.felt[0].proxy.back().position - Vec3(0.1, 0, 0.103);
  const double below = 0.011, away = std::hypot(tool.x(), tool.z());
  const double open_rad = std::atan2(tool.z(), -tool.x()) + std::asin(below / away);
  const double force_n = 0.3 * kG * 0.11 * std::cos(open_rad) / std::sqrt(away * away - below * below);
  const Vec3 felt = mean_force(run, 0.95, 1.0);
  EXPECT_NEAR(felt.norm() / force_n, 1.0, 0.01);
  EXPECT_NEAR(-felt.z() / felt.norm(), std::cos(open_rad), 0.01);
}

TEST(Mechanism, ALatchSnapsAtTheForceOfItsSpringOnTheSlope) {
  Scene scene = shipped("latch", 10);
  scene.settings.duration_s = 1.2;
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  const auto& felt = run.felt[0].on_operator;
  const auto most = std::ranges::max_element(felt, {}, [](const Vec3& force) { return force.x(); });
  // Where the round end of the bolt leaves the slope of 45 degrees it is 8 mm - 6 mm + 5 mm cos 45 above the rest.
  const double spring_n = 400.0 * (0.01 + 0.002 + 0.005 * std::sqrt(0.5));
  EXPECT_NEAR(most->x() / (spring_n * std::tan(M_PI / 4 + std::atan(0.15)) + 0.5), 1.0, 0.03);
  EXPECT_LT(mean_force(run, 1.15, 1.2).x(), 0.5) << "it snaps";
}

TEST(Assembly, APegIsHeldByItsHole) {
  constexpr double kStiffness = 1000.0, kTurnStiffness = 5.0, kFriction = 0.3, kBeside_m = 0.0015, kPlay_m = 0.0001;
  Scene scene = shipped("peg", 10);
  scene.settings.duration_s = 1.95;
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  const double side_n = kStiffness * (kBeside_m - 0.5 * kPlay_m);
  for (const FeltHistory& felt : run.felt) {
    const Vec3 force = felt.force[1249];
    EXPECT_NEAR(force.x() / side_n, 1.0, 0.01);
    EXPECT_NEAR(-force.z() / (kFriction * side_n), 1.0, 0.03);
  }
  // Two points hold the tilted peg at an angle of play / depth; corners hold the twisted one at play / side.
  const double depth = 0.038 - (run.felt[0].proxy.back().position.z() - 0.025);
  const double turned_rad = 1.5 * M_PI / 180;
  EXPECT_NEAR(run.felt[0].torque.back().y() / (kTurnStiffness * (turned_rad - kPlay_m / depth)), 1.0, 0.01);
  EXPECT_NEAR(run.felt[1].torque.back().z() / (kTurnStiffness * (turned_rad - kPlay_m / 0.02)), 1.0, 0.01);
}

TEST(Assembly, ACoverIsHeldByFrictionOnItsPins) {
  Scene scene = shipped("assembly", 10);
  scene.settings.duration_s = 0.9;
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  const double side_n = 1000.0 * (0.0015 - 0.0001);
  EXPECT_NEAR(run.felt[0].force.back().y() / side_n, 1.0, 0.01);
  EXPECT_NEAR(run.felt[0].force.back().z() / (0.3 * kG - 0.3 * side_n), 1.0, 0.03);
}

TEST(Assembly, IsFeltAsInOneWorld) {
  for (const char* name : {"peg", "box_with_lid", "latch", "assembly"}) {
    const auto run_with = [&](const Scene& whole) {
      Scene scene = whole;
      keep_users(scene, 1);
      scene.settings.duration_s = std::min(1.2, scene.settings.duration_s);
      CoupledRun run(scene);
      EXPECT_TRUE(run.run()) << name;
      return run.felt[0].force;
    };
    const auto reference = run_with(shipped(name, 1, 0.0, "direct"));
    EXPECT_LT(force_error(run_with(shipped(name, 20)), reference, 1e-3).rms, 0.01) << name;
    EXPECT_LT(force_error(run_with(shipped(name, 5, 0.1)), reference, 1e-3).rms, 0.01) << name;
  }
}

TEST(Mechanism, IsInTheSubWorldAsAWhole) {
  Scene scene = shipped("chain", 4);
  scene.settings.duration_s = 0.8;     // until the tool pushes the load
  scene.users[0].budget_ratio = 0.02;  // room for the tool and two bodies
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  EXPECT_EQ(run.frame().members.size(), 32U);  // of a box of 0.4 m around a chain of 0.9 m
  EXPECT_TRUE(std::ranges::any_of(run.frame().fixed, [&](BodyId id) { return scene.body(id).name == "hook"; }));
}

constexpr const char* kHook = R"(
name: hook
settings: {{duration_s: 1.5, ratio: 4, users: 1}}
bodies:
  - {{name: post, shape: box, size_m: [0.05, 0.05, 0.05], fixed: true, position_m: [0, 0, 1]}}
  - {{name: plate, shape: box, size_m: [0.1, 0.1, 0.02], mass_kg: 0.5, position_m: [0, 0, 0.8]}}
joints:
  - {{name: glue, type: {}}}
users:
  - name: user
    proxy: {{shape: sphere, radius_m: 0.03, mass_kg: 0.1, position_m: [0, 0, 0.85], rotates: false, gravity: false}}
    device: {{profile: minimum_jerk, path: [{{move: [0, 0, -0.03], during_s: [0.1, 0.6]}}, {{move: [0, 0, 0.06], during_s: [0.8, 1.4]}}]}}
)";

TEST(Mechanism, AJointThatBreaksIsGoneInTheSubWorldToo) {
  // The joint carries the weight of 4.9 N, and then the 20 N of the tool.
  const auto run_with = [](double break_n) {
    const std::string joint = fmt::format("fixed, bodies: [plate, post], break_force_n: {}", break_n);
    CoupledRun run(load_text(fmt::format(fmt::runtime(kHook), joint)));
    EXPECT_TRUE(run.run());
    return std::tuple(run.frame().broken_joints, mean_force(run, 0.65, 0.75).z(), run.world.facts());
  };
  const auto [whole, felt_n, facts] = run_with(100.0);
  EXPECT_TRUE(whole.empty());
  EXPECT_NEAR(felt_n, 1000.0 * 0.02, 0.5);  // the device is 20 mm inside
  const auto [broken, left_n, after] = run_with(10.0);
  EXPECT_EQ(broken, (std::vector<std::uint32_t>{0}));
  EXPECT_NEAR(left_n, 0.0, 0.1);
  EXPECT_LT(after.energy_excess_j, 1e-3);
}

TEST(Mechanism, SpringsAndMotorsCreateNoEnergy) {
  // A spring lifts the plate towards the tool; a motor presses it there.
  for (const char* drive : {"stiffness_n_m: 400, damping_n_s_m: 4, rest_m: 0.1", "speed_m_s: 0.2, force_limit_n: 12"}) {
    const std::string joint =
        fmt::format("slider, bodies: [plate, post], at_m: [0, 0, 0.8], axis: [0, 0, 1], slide: {{{}}}", drive);
    CoupledRun run(load_text(fmt::format(fmt::runtime(kHook), joint)));
    ASSERT_TRUE(run.run());
    EXPECT_LT(run.world.facts().energy_excess_j, 5e-3) << drive;
    EXPECT_LT(run.guards[0]->port().created_j(), 1e-3) << drive;
    EXPECT_GT(mean_force(run, 0.65, 0.75).z(), 5.0) << drive;
  }
}

}  // namespace
}  // namespace subworld
