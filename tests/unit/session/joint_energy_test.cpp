#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "physics/shells/engine_shell.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>

namespace subworld {
namespace {

TEST(EnergyPort, CountsWhatIsTakenFromAnEmptyStoreAsCreated) {
  EnergyPort port(0.8);
  double none_j = 0.0;
  port.flow(5.0, false, none_j);  // friction has dissipated most of it
  EXPECT_DOUBLE_EQ(port.level_j(), 0.8);
  port.flow(-0.7, false, none_j);
  EXPECT_DOUBLE_EQ(port.created_j(), 0.0);
  port.flow(-0.3, false, none_j);
  EXPECT_NEAR(port.created_j(), 0.2, 1e-12);
  EXPECT_DOUBLE_EQ(port.level_j(), 0.0);
  EXPECT_DOUBLE_EQ(port.net_j(), 4.0);
  EXPECT_DOUBLE_EQ(port.least_j(), 0.0);
  port.flow(3.0, true, none_j);  // a saturated spring has stored all of it
  port.flow(-3.0, true, none_j);
  EXPECT_NEAR(port.created_j(), 0.2, 1e-12);
}

/// Two users press a cube from both sides. The first pushes the other back, and is pushed back by less.
Scene pushed_back(const std::string& scheme, int ratio, double latency_s, Passivity passivity) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/lift.yaml");
  scene.settings.users = 2;
  scene.settings.duration_s = 2.0;
  scene.settings.scheme = scheme;
  scene.settings.set_ratio({ratio, ratio});
  scene.settings.delay.up_s = scene.settings.delay.down_s = 0.5 * latency_s;
  scene.settings.passivity = passivity;
  scene.users[0].device.path = {{.from_s = 0.2, .to_s = 0.5, .displacement = {0.03, 0, 0}},
                                {.from_s = 0.6, .to_s = 1.2, .displacement = {0.06, 0, 0}},
                                {.from_s = 1.4, .to_s = 1.8, .displacement = {-0.03, 0, 0}}};
  scene.users[1].device.path = {{.from_s = 0.2, .to_s = 0.5, .displacement = {-0.03, 0, 0}},
                                {.from_s = 0.6, .to_s = 1.2, .displacement = {0.055, 0, 0}},
                                {.from_s = 1.4, .to_s = 1.8, .displacement = {-0.03, 0, 0}}};
  return scene;
}

/// The port of the second user of that scene, and the device.
class SecondPort : public ::testing::Test {
 protected:
  /// Moves the device along a constant force on the operator, or against it (< 0).
  void give(double energy_j) {
    constexpr double kForce_n = 2.0;
    port.hold({Vec3(kForce_n, 0, 0), Vec3::Zero()});
    state.pose.position.x() += energy_j / kForce_n;
    port.step(state);
  }

  Scene scene = pushed_back("reduced", 4, 0.0, Passivity::on);
  OperatorPort port{scene, 1};
  DeviceState state;

  void SetUp() override { port.step(state); }
};

TEST_F(SecondPort, GivesWhatTheOtherOperatorPutIn) {
  port.share({0.05});
  EXPECT_DOUBLE_EQ(port.stored_j(), 0.05);
  give(0.03);
  EXPECT_NEAR(port.stored_j(), 0.02, 1e-12);
  EXPECT_DOUBLE_EQ(port.created_j(), 0.0);
  EXPECT_NEAR(port.net_j(), -0.03, 1e-12);
  give(0.04);
  EXPECT_NEAR(port.created_j(), 0.02, 1e-12) << "that is nobody's";
}

TEST_F(SecondPort, DoesNotGiveTwiceWhatWentBackToTheOther) {
  port.share({0.05});
  port.share({0.01});  // the other one took 0.04 J back
  give(0.03);
  EXPECT_NEAR(port.created_j(), 0.02, 1e-12);
  give(-0.05);
  port.share({-0.02});  // and 0.03 J of this operator's
  EXPECT_NEAR(port.stored_j(), 0.02, 1e-12);
}

// A tool that turns against an obstacle pushes back with a force: what went in by the torque may come out by it.
TEST(OneTank, OfForceAndTorque) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/press_turn.yaml");
  scene.users[0].device.degrees_of_freedom = 6;
  OperatorPort port(scene, 0);
  DeviceState device;
  port.hold({Vec3::Zero(), Vec3(0, 0, -1)});
  port.step(device);
  device.pose.orientation = Quat(Eigen::AngleAxisd(0.05, Vec3::UnitZ()));
  port.step(device);
  EXPECT_NEAR(port.stored_j(), 0.05, 1e-4);
  port.hold({Vec3(2, 0, 0), Vec3::Zero()});
  device.pose.position.x() = 0.02;
  port.step(device);
  EXPECT_NEAR(port.stored_j(), 0.01, 1e-4);
  EXPECT_DOUBLE_EQ(port.created_j(), 0.0);
  device.pose.position.x() = 0.03;
  port.step(device);
  EXPECT_NEAR(port.created_j(), 0.01, 1e-4);
}

TEST_F(SecondPort, DoesNotHoldMoreThanTheCouplingsOfTheOthersStore) {
  for (int i = 1; i <= 100; ++i) port.share({0.1 * i});  // friction has dissipated most of it
  EXPECT_NEAR(port.stored_j(), 40.0 * 40.0 / (2.0 * 1000.0), 1e-12);
  port.share({1e9});
  port.share({NAN});
  EXPECT_NEAR(port.stored_j(), 0.8, 1e-12) << "no device can do that in a step";
  give(0.5);
  port.share({1e9 + 0.25});
  EXPECT_NEAR(port.stored_j(), 0.55, 1e-6) << "the account goes on";
}

TEST(JointEnergy, AnOperatorIsPushedBackByAnotherWithTheForceThatThereIsWithoutABound) {
  struct Case {
    const char* scheme;
    int ratio;
    double latency_s;
  };
  for (const auto& [scheme, ratio, latency_s] :
       {Case{"reduced", 1, 0.0}, Case{"reduced", 4, 0.0}, Case{"reduced", 20, 0.0}, Case{"reduced", 5, 0.05},
        Case{"direct", 4, 0.0}, Case{"paper", 4, 0.0}}) {
    SCOPED_TRACE(fmt::format("{}, r = {}, delay {} s", scheme, ratio, latency_s));
    CoupledRun bounded(pushed_back(scheme, ratio, latency_s, Passivity::on));
    CoupledRun unbounded(pushed_back(scheme, ratio, latency_s, Passivity::off));
    ASSERT_TRUE(bounded.run() && unbounded.run());
    bounded.close();
    for (std::size_t u = 0; u < 2; ++u) {
      const double h_s = 1e-3;
      EXPECT_LT(force_error(bounded.felt[u].on_operator, unbounded.felt[u].on_operator, h_s).rms, 0.02) << u;
      EXPECT_LT(bounded.guards[u]->port().created_j(), 1e-3) << u;
    }
    EXPECT_LT(bounded.world.facts().operators_created_j, 1e-3);
    EXPECT_LT(bounded.guards[1]->port().least_j(), -0.2) << "the work of the first operator";
  }
}

// Messages that are late, in bursts, and lost: the world receives the impulse that the devices gave, no more and no
// less.
TEST(JointImpulse, OfTheDevicesIsThatOfTheWorld) {
  for (const char* scheme : {"reduced", "paper"}) {
    Scene scene = pushed_back(scheme, 4, 0.02, Passivity::off);
    scene.settings.delay.jitter_s = 0.02;
    scene.settings.delay.loss_ratio = 0.1;
    // Both retreat at the end, so that the last reports say the same as the ones before.
    scene.users[0].device.path.push_back({.from_s = 1.8, .to_s = 1.85, .displacement = {-0.06, 0, 0}});
    scene.users[1].device.path.push_back({.from_s = 1.8, .to_s = 1.85, .displacement = {0.06, 0, 0}});
    scene.settings.duration_s = 2.7;
    CoupledRun run(scene);
    ASSERT_TRUE(run.run());
    for (std::size_t u = 0; u < 2; ++u) {
      const Vec3 given = run.report(u).impulse_total.force, received = run.world.user_facts(u).impulse.force;
      ASSERT_GT(given.norm(), 0.5) << scheme;
      EXPECT_LT((given - received).norm(), 1e-9 * given.norm()) << scheme << " " << u;
    }
  }
}

// The port of the second operator gives 0.2 J more than there is.
TEST(JointEnergy, OfNobodyIsSeenByTheWorld) {
  Scene scene = pushed_back("reduced", 4, 0.0, Passivity::off);
  CoupledRun run(scene);
  for (int i = 0; i < 100; ++i) run.cycle();
  HapticReport report = run.report(1);
  ASSERT_LT(run.world.facts().operators_created_j, 1e-3);
  report.members.clear();  // no body gives energy
  World world(scene);
  ASSERT_TRUE(world.settle([](double) { return true; }));
  for (std::uint64_t stamp = 0; stamp < 20; ++stamp) {
    for (const std::uint32_t u : {0U, 1U}) {
      report.user = UserId{u};
      report.stamp = stamp;
      report.stamp_s = 4e-3 * static_cast<double>(stamp);
      report.operator_work_j = u == 0 ? 2e-3 * static_cast<double>(stamp) : -12e-3 * static_cast<double>(stamp);
      HapticReport sent = report;
      ASSERT_TRUE(world.receive(std::move(sent)));
    }
    world.step();
  }
  EXPECT_NEAR(world.facts().operators_created_j, 0.19, 0.01) << "10 mJ a cycle; the cube comes to rest with less";
}

/// Throws the first body and stops it again, as an engine does that fails.
class Throwing final : public EngineShell {
 public:
  explicit Throwing(std::unique_ptr<Engine> inner) : inner_(std::move(inner)) {}
  void stepped(double /*dt*/) override {
    ++steps_;
    if (steps_ % 20 == 0)
      inner_->set_velocity(BodyId{0}, (steps_ % 40 == 0 ? 0.0 : 10.0) * Vec3::UnitX(), Vec3::Zero());
  }

 private:
  Engine& inner() const noexcept override { return *inner_; }
  std::unique_ptr<Engine> inner_;
  int steps_ = 0;
};

TEST(EnergyOfBodies, WhatNobodyExplainsIsNotReleased) {
  const Scene scene = load_text(R"(
name: thrown
settings: {duration_s: 0.8, ratio: 4, users: 1}
bodies:
  - {name: ball, shape: sphere, radius_m: 0.1, mass_kg: 1, position_m: [0, 0, 5], gravity: false}
users:
  - {name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, gravity: false}}
)");
  CoupledRun run(scene, [](const EngineSettings& settings, std::span<const Mesh> meshes) -> std::unique_ptr<Engine> {
    return std::make_unique<Throwing>(make_engine(settings, meshes));
  });
  ASSERT_TRUE(run.run());
  EXPECT_NEAR(run.world.facts().energy_excess_j, 50.0, 1.0);
  EXPECT_LT(run.world.facts().released_j, 0.1);
}

}  // namespace
}  // namespace subworld
