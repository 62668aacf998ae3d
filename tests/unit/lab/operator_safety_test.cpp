// The safety stages between a computed force and an operator, and their measurements.
#include "coupling/safety/energy_port.hpp"
#include "coupling/safety/motion_guard.hpp"
#include "coupling/safety/oscillation.hpp"
#include "coupling/safety/passivity.hpp"
#include "coupling/tool/stiffness.hpp"
#include "device_sim/device_guard.hpp"
#include "device_sim/emulated_device.hpp"
#include "lab/session/operator_bed.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <limits>

namespace subworld {
namespace {

/// b (1 - a) / (tau (1 - a) - a T) (Gil, Avello, Rubio, Florez 2004).
double exact_stiffness(const SampledWall& wall) {
  const double a = std::exp(-wall.damping_n_s_m * wall.period_s / wall.mass_kg);
  const double tau = wall.mass_kg / wall.damping_n_s_m;
  return wall.damping_n_s_m * (1 - a) / (tau * (1 - a) - a * wall.period_s);
}

TEST(LargestStiffness, IsTheExactRootWithoutDelay) {
  for (const double mass : {0.02, 0.1, 1.0}) {
    for (const double damping : {0.1, 0.5, 5.0}) {
      for (const double period : {0.25e-3, 1e-3, 4e-3}) {
        const SampledWall wall{.mass_kg = mass, .damping_n_s_m = damping, .period_s = period};
        EXPECT_NEAR(largest_stiffness(wall) / exact_stiffness(wall), 1.0, 1e-6)
            << mass << " " << damping << " " << period;
      }
    }
  }
}

// Roots of the characteristic polynomial, found independently with a general eigenvalue solver.
TEST(LargestStiffness, FallsWithDelay) {
  const std::vector<std::pair<int, double>> known{{0, 1000.8}, {1, 333.8}, {5, 91.3}, {20, 24.8}};
  for (const auto& [delay, stiffness] : known) {
    SampledWall wall;
    wall.delay = delay;
    EXPECT_NEAR(largest_stiffness(wall), stiffness, 0.002 * stiffness) << delay;
  }
}

TEST(LargestStiffness, IsNoneWhereTheDampingAloneIsTooMuch) {
  EXPECT_EQ(largest_stiffness({.wall_damping_n_s_m = 250.0}), 0.0);
  EXPECT_GT(largest_stiffness({.wall_damping_n_s_m = 20.0}), 1000.8);
}

/// The largest displacement in the last quarter over that in the first: < 1 means decay.
double growth(const SampledWall& wall, double stiffness_n_m, double rate_hz) {
  DeviceSpec spec;
  spec.mass_kg = 0.5 * wall.mass_kg;
  spec.damping_n_s_m = 0.5 * wall.damping_n_s_m;
  spec.friction_n = 0.0;
  spec.rate_hz = rate_hz;
  spec.force_limit_n = 1e9;
  spec.operator_model =
      OperatorSpec{.mass_kg = 0.5 * wall.mass_kg, .damping_n_s_m = 0.5 * wall.damping_n_s_m, .stiffness_n_m = 1e-9};
  EmulatedDevice device(spec, 0);
  std::deque<DeviceState> past(static_cast<std::size_t>(wall.delay) + 1, device.state());
  DeviceCommand command;
  command.wrench.force = Vec3(0.1, 0, 0);
  device.step(command, wall.period_s);
  const int steps = 8000 * (1 + wall.delay);
  double first = 0.0, last = 0.0;
  for (int i = 0; i < steps; ++i) {
    past.push_back(device.state());
    past.pop_front();
    const DeviceState& seen = past.front();
    command.wrench.force = -stiffness_n_m * seen.pose.position - wall.wall_damping_n_s_m * seen.linear_velocity;
    device.step(command, wall.period_s);
    const double x = device.state().pose.position.norm();
    if (i < steps / 4) first = std::max(first, x);
    if (i >= 3 * steps / 4) last = std::max(last, x);
    if (x > 1e3) return INFINITY;
  }
  return last / first;
}

class HeldForce : public ::testing::TestWithParam<SampledWall> {};

TEST_P(HeldForce, OfTheEmulatedDeviceIsStableUpToTheExactRoot) {
  const double edge = largest_stiffness(GetParam());
  const double rate_hz = 1.0 / GetParam().period_s;
  EXPECT_LT(growth(GetParam(), 0.98 * edge, rate_hz), 1.0);
  EXPECT_GT(growth(GetParam(), 1.02 * edge, rate_hz), 1.0);
}

INSTANTIATE_TEST_SUITE_P(Walls, HeldForce,
                         ::testing::Values(SampledWall{}, SampledWall{.delay = 1}, SampledWall{.delay = 5},
                                           SampledWall{.mass_kg = 0.5, .damping_n_s_m = 2.0, .period_s = 4e-3},
                                           SampledWall{.wall_damping_n_s_m = 20.0},
                                           SampledWall{.delay = 3, .wall_damping_n_s_m = 5.0}));

// A slower device samples less often, independent of the rate of the calls.
TEST(EmulatedDevice, WorksAtItsOwnRate) {
  const SampledWall slow{.period_s = 4e-3};
  const double edge = largest_stiffness(slow);
  SampledWall asked_often = slow;
  asked_often.period_s = 1e-3;
  EXPECT_LT(growth(asked_often, 0.97 * edge, 250.0), 1.0);
  EXPECT_GT(growth(asked_often, 1.03 * edge, 250.0), 1.0);
}

TEST(EmulatedDevice, FrictionStopsAndHolds) {
  DeviceSpec spec;
  spec.friction_n = 0.5;
  spec.operator_model = OperatorSpec{.damping_n_s_m = 1e-9, .stiffness_n_m = 1e-9};
  spec.damping_n_s_m = 0.0;
  EmulatedDevice device(spec, 0);
  DeviceCommand command;
  command.wrench.force = Vec3(0.49, 0, 0);
  for (int i = 0; i < 100; ++i) device.step(command, 1e-3);
  EXPECT_EQ(device.state().pose.position.x(), 0.0) << "less than the friction";
  command.wrench.force = Vec3(1.6, 0, 0);
  for (int i = 0; i < 100; ++i) device.step(command, 1e-3);
  EXPECT_NEAR(device.state().pose.position.x(), 0.5 * 1.0 * 0.01, 1e-9) << "1.1 N on 1.1 kg for 0.1 s";
  command.wrench.force.setZero();
  for (int i = 0; i < 300; ++i) device.step(command, 1e-3);
  EXPECT_NEAR(device.state().pose.position.x(), 0.005 + 0.1 * 0.1 / (2 * 0.5 / 1.1), 1e-6) << "v^2 / 2a";
  EXPECT_EQ(device.state().linear_velocity.x(), 0.0);
}

TEST(EmulatedDevice, TremblesByTheAmplitudeOfItsOperator) {
  DeviceSpec spec;
  spec.friction_n = 0.0;
  spec.operator_model = OperatorSpec{.tremor = {.frequency_hz = 10.0, .amplitude_m = 1e-4}};
  const auto course = [&](std::uint32_t number) {
    EmulatedDevice device(spec, number);
    std::vector<Vec3> positions;
    for (int i = 0; i < 3000; ++i) {
      device.step({}, 1e-3);
      if (i >= 2000) positions.push_back(device.state().pose.position);
    }
    return positions;
  };
  const std::vector<Vec3> mine = course(1);
  double most_m = 0.0;
  for (const Vec3& at : mine) most_m = std::max(most_m, at.norm());
  EXPECT_NEAR(most_m, 1e-4, 1e-6);
  EXPECT_LT((mine[50] + mine[0]).norm(), 1e-6) << "half a period";
  EXPECT_EQ(course(1), mine);
  EXPECT_GT((course(2).front() - mine.front()).norm(), 1e-6);
}

TEST(MotionGuard, PassesWhatIsWithinTheLimitsBitByBit) {
  MotionGuard guard(0.4, 4.0);
  DeviceMotion motion;
  for (int i = 0; i < 1000; ++i) {
    motion.pose.position.x() += 0.39e-3;
    motion.linear_velocity.x() = 0.39;
    const DeviceMotion out = guard.pass(motion, true, 1e-3);
    ASSERT_EQ(out.pose.position, motion.pose.position);
    ASSERT_EQ(out.linear_velocity, motion.linear_velocity);
  }
}

TEST(MotionGuard, NeverMovesFasterThanItsLimitNorToNowhere) {
  MotionGuard guard(0.4, 4.0);
  (void)guard.pass({}, true, 1e-3);
  Vec3 before = Vec3::Zero();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 300; ++i) {
    DeviceMotion wanted;
    wanted.pose.position = i % 3 == 0 ? Vec3(1e9, 0, 0) : i % 3 == 1 ? Vec3(nan, 0, 0) : Vec3(-5, 3, 0);
    wanted.linear_velocity = Vec3(i % 5 == 0 ? nan : 1e9, 0, 0);
    const DeviceMotion out = guard.pass(wanted, i % 7 != 0, 1e-3);
    ASSERT_LE((out.pose.position - before).norm(), 0.4e-3 * (1 + 1e-6));
    ASSERT_LE(out.linear_velocity.norm(), 0.4 * (1 + 1e-6));
    before = out.pose.position;
  }
}

TEST(OscillationWatch, DistinguishesVibrationFromMotionAndImpact) {
  const auto watched = [](auto&& force_n) {
    OscillationWatch watch;
    for (int i = 0; i < 3000; ++i) watch.step(Vec3(force_n(i * 1e-3), 0, 0), 1e-3);
    return watch.worst_n();
  };
  EXPECT_NEAR(watched([](double t) { return 5.0 + 3.0 * std::sin(2 * M_PI * 50 * t); }), 3.0 / std::sqrt(2.0), 0.1);
  EXPECT_NEAR(watched([](double t) { return std::lround(t * 1e3) % 2 == 0 ? 4.0 : -4.0; }), 4.0, 0.2);
  EXPECT_EQ(watched([](double t) { return 20.0 * std::sin(2 * M_PI * 3 * t); }), 0.0);
  EXPECT_LT(watched([](double t) { return 20.0 * std::exp(-20 * t) * std::sin(2 * M_PI * 50 * t); }), 0.01);
}

struct Delayed {
  const char* scene;
  DeviceKind kind;
  const char* scheme;
  Side side;
};
void PrintTo(const Delayed& one, std::ostream* out) {
  *out << one.scene << (one.kind == DeviceKind::impedance ? "_impedance_" : "_admittance_") << one.scheme
       << (one.side == Side::device ? "_device" : "_world");
}

std::vector<Delayed> delayed() {
  std::vector<Delayed> all;
  for (const char* scene : {"press", "row"}) {
    for (const DeviceKind kind : {DeviceKind::impedance, DeviceKind::admittance}) {
      for (const char* scheme : {"direct", "paper", "reduced"}) {
        for (const Side side : {Side::world, Side::device}) all.push_back({scene, kind, scheme, side});
      }
    }
  }
  return all;
}

Scene delayed_scene(const Delayed& one) {
  Scene scene = scene_with_operator(one.scene, one.kind);
  scene.settings.scheme = one.scheme;
  lengthen(scene, one.side, 0.2);
  return scene;
}

class Passivity200ms : public ::testing::TestWithParam<Delayed> {};

// Net energy from the operator, computed from the true motion of the device: more than -1 mJ for all links.
TEST_P(Passivity200ms, NoOperatorReceivesEnergyThatWasNotPutIn) {
  CoupledRun run(delayed_scene(GetParam()));
  ASSERT_TRUE(run.run());
  EXPECT_GT(run.guards[0]->port().least_j(), -1e-3);
}

INSTANTIATE_TEST_SUITE_P(Links, Passivity200ms, ::testing::ValuesIn(delayed()));

TEST(Passivity, IsNeededThere) {
  Scene scene = delayed_scene({"press", DeviceKind::impedance, "reduced", Side::device});
  scene.settings.passivity = Passivity::off;
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  EXPECT_LT(run.guards[0]->port().least_j(), -1.0);
  EXPECT_GT(run.guards[0]->port().created_j(), 1.0);
}

// An operator who accelerates and stops gets back the kinetic energy of the proxy: no energy of bodies.
TEST(ReleasedEnergy, IsNotThatOfAProxyInTheAir) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  keep_users(scene, 1);
  scene.settings.duration_s = 0.4;
  scene.users[0].device.path = {{.from_s = 0.1, .to_s = 0.3, .displacement = {-0.1, 0, 0}}};
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  ASSERT_LT(run.felt[0].proxy.back().position.x(), -0.19) << "it moved with 0.5 m/s: 12 mJ";
  EXPECT_LT(run.world.facts().released_j, 1e-4);
}

TEST(Passivity, ChangesNothingWithoutDelay) {
  for (const DeviceKind kind : {DeviceKind::impedance, DeviceKind::admittance}) {
    Scene scene = scene_with_operator("press", kind);
    CoupledRun as_needed(scene);
    scene.settings.passivity = Passivity::off;
    CoupledRun off(scene);
    ASSERT_TRUE(as_needed.run() && off.run());
    EXPECT_EQ(as_needed.world.facts().state_hash, off.world.facts().state_hash);
    EXPECT_EQ(as_needed.felt[0].on_operator, off.felt[0].on_operator);
  }
}

// An operator at rest in free space: for any cycle and delay, an admittance device must not drift away.
TEST(Admittance, InFreeSpaceStaysSlow) {
  for (const char* scheme : {"direct", "paper", "reduced"}) {
    for (const int ratio : {1, 4, 20}) {
      for (const double latency_s : {0.0, 0.005, 0.1}) {
        Scene scene = free_scene(DeviceKind::admittance);
        scene.settings.scheme = scheme;
        scene.settings.set_ratio({ratio, ratio});
        lengthen(scene, Side::world, latency_s, 0.0, 0.0);
        CoupledRun run(scene);
        double fastest = 0.0;
        while (run.finite() && run.world.facts().time_s < scene.settings.duration_s) {
          run.cycle();
          fastest = std::max(fastest, run.devices[0]->state().linear_velocity.norm());
        }
        EXPECT_LT(fastest, 0.5) << scheme << " " << ratio << " " << latency_s;
        EXPECT_LT(run.guards[0]->port().created_j(), 0.005) << scheme << " " << ratio << " " << latency_s;
      }
    }
  }
}

TEST(SubWorld, MeetsADeviceThatJumpsFromZero) {
  Scene scene = scene_with_operator("press", DeviceKind::impedance);
  CoupledRun run(scene);
  for (int i = 0; i < 60; ++i) run.cycle();
  SubWorld& sub = *run.subs[0];
  DeviceState state = run.devices[0]->state();
  const auto step = [&] {
    return sub.step(
        {.device = &state, .wall_s = 1e-3, .dt = 1e-3}, [](const FeltStep&) {}, [] {});
  };
  Vec3 before = step().to_operator.force;
  const Vec3 device = sub.device().pose().pose.position;
  state.pose.position += Vec3(0.5, 0, 0);
  for (int i = 0; i < 40; ++i) {
    state.stamp_s += 1e-3;
    const FeltStep felt = step();
    EXPECT_LE((felt.to_operator.force - before).norm(), 1.0);
    if (i == 0) {
      EXPECT_LT((sub.device().pose().pose.position - device).norm(), 1e-3) << "it is met where it is";
    }
    if (i == 20) {
      EXPECT_LT(felt.to_operator.force.norm(), 0.1);
    }
    before = felt.to_operator.force;
  }
  EXPECT_EQ(sub.device().jumps(), 1U);
}

// Faster than an operator moves: the force is off meanwhile, and comes back with a ramp when the device is slow again.
TEST(SubWorld, ReengagesADeviceThatWasTooFast) {
  Scene scene = scene_with_operator("press", DeviceKind::impedance);
  CoupledRun run(scene);
  for (int i = 0; i < 200; ++i) run.cycle();  // it presses
  SubWorld& sub = *run.subs[0];
  DeviceState state = run.devices[0]->state();
  const auto step = [&](const Vec3& velocity) {
    state.stamp_s += 1e-3;
    state.linear_velocity = velocity;
    state.pose.position += 1e-3 * velocity;
    return sub
        .step(
            {.device = &state, .wall_s = 1e-3, .dt = 1e-3}, [](const FeltStep&) {}, [] {})
        .to_operator.force;
  };
  for (int i = 0; i < 800; ++i) {
    const Vec3 force = step({20.0, 0, 0});
    if (i > 40) {
      EXPECT_LT(force.norm(), 0.1);
    }
  }
  EXPECT_EQ(sub.device().jumps(), 800U);
  Vec3 before = Vec3::Zero();
  for (int i = 0; i < 300; ++i) {
    const Vec3 force = step({0.01, 0, 0});
    EXPECT_LE((force - before).norm(), 1.0);
    before = force;
  }
  EXPECT_EQ(sub.device().jumps(), 800U);
  EXPECT_GT(before.norm(), 5.0) << "it presses again";
}

}  // namespace
}  // namespace subworld
