// Where a peer's device is by now: movements of an arm, with and without noise, and velocities that jump.
#include "haptic_sim/peer_forecast.hpp"
#include "haptic_sim/sub_world.hpp"
#include "model/scene/scene.hpp"
#include "support/scene_text.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <string>

namespace subworld {
namespace {

/// RMS error, m, of the position `ahead_s` after the newest state, while a device moves by 8 cm within 0.7 s.
double error(Profile profile, double ahead_s, double noise_m_s, bool with_acceleration) {
  const std::vector<PathSegment> path{
      {.from_s = 0.1, .to_s = 0.8, .profile = profile, .displacement = Vec3(0.08, 0, 0)}};
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, noise_m_s);
  PeerForecast forecast;
  double sum = 0.0;
  int count = 0;
  for (double t = 0.0; t < 1.0; t += 1e-3, ++count) {
    const PathPoint at = evaluate(path, t);
    DeviceState state;
    state.stamp_s = t;
    state.pose.position = at.offset.position;
    state.linear_velocity = at.linear_velocity;
    if (noise_m_s > 0.0) state.linear_velocity.x() += noise(random);
    forecast.observe(state);
    DevicePose device{.pose = state.pose};
    forecast.advance(device, ahead_s, 1.0);
    if (!with_acceleration) device.pose.position = state.pose.position + ahead_s * state.linear_velocity;
    sum += (device.pose.position - evaluate(path, t + ahead_s).offset.position).squaredNorm();
  }
  return std::sqrt(sum / count);
}

TEST(PeerForecast, FollowsAnArm) {
  EXPECT_LT(error(Profile::minimum_jerk, 0.02, 0.0, true), 0.35 * error(Profile::minimum_jerk, 0.02, 0.0, false));
  EXPECT_LT(error(Profile::minimum_jerk, 0.1, 0.0, true), 0.6 * error(Profile::minimum_jerk, 0.1, 0.0, false));
}

// Encoders of 10 um at 1 kHz.
TEST(PeerForecast, IsNotWorseForNoise) {
  constexpr double kNoise_m_s = 0.003;
  for (const double ahead_s : {0.02, 0.1}) {
    EXPECT_LT(error(Profile::minimum_jerk, ahead_s, kNoise_m_s, true),
              0.8 * error(Profile::minimum_jerk, ahead_s, kNoise_m_s, false));
  }
}

TEST(PeerForecast, GoesOnAtTheVelocityThatHasJumped) {
  EXPECT_NEAR(error(Profile::constant, 0.1, 0.0, true), error(Profile::constant, 0.1, 0.0, false), 1e-12);
}

/// Where the sub-world of user 0 of `lift` has the proxy of user 1 after 10 steps on a clock of this rate. The world's
/// account of the device is of the device's time 1 s; `heard` is its newest state.
double peer_x_m(const DeviceState& heard, double rate) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/lift.yaml");
  keep_users(scene, 2);
  scene.settings.disable(disabled(Optimisation::suppression));  // every cycle has its messages, as in real time
  World world(scene);
  world.settle([](double) { return true; });
  WorldFrame frame = world.frame(0);
  const BodyId proxy = scene.users[1].proxy;
  frame.peers = {{.proxy = proxy, .pose = {scene.initial[index(proxy)].position}, .device_s = 1.0}};
  SubWorld sub(scene, 0);
  sub.synchronise_with(world.frame(0));
  EXPECT_TRUE(sub.reset_from(frame));
  DeviceState own;
  own.pose.position = scene.initial[index(scene.users[0].proxy)].position;
  const std::array<const DeviceState*, 2> peers{nullptr, &heard};
  double x_m = NAN;
  for (int step = 0; step < 12; ++step) {
    (void)sub.step(
        {.device = &own, .peers = peers, .wall_s = 0.001 / rate, .dt = 0.001, .clock_rate = rate},
        [](const FeltStep&) {},
        [&] {
          for (const StampedBody& member : sub.close_cycle(1)->members)
            if (member.id == proxy) x_m = member.state.position.x();
        });
  }
  return x_m;
}

DeviceState device_at(double x_m, double stamp_s) {
  DeviceState state;
  state.pose.position = {x_m, 0.0, 0.05};
  state.stamp_s = stamp_s;
  state.sender = 7;
  return state;
}

TEST(PeerInASubWorld, FollowsTheNewestStateOfItsDevice) {
  EXPECT_NEAR(peer_x_m(device_at(0.11, 1.005), 1.0), 0.11, 0.008);
}

// The device was started again, and the account does not know yet where its motion begins.
TEST(PeerInASubWorld, WaitsForTheAccountOfADeviceThatWasStartedAgain) {
  EXPECT_NEAR(peer_x_m(device_at(0.13, 6.0), 1.0), 0.10, 1e-4);
}

// 12 ms on a clock of the rate 0.02 are 0.6 s of the peer's operator, of which 0.2 s are guessed.
TEST(PeerInASubWorld, IsGuessedForAShortTimeOfItsOperatorWhateverTheClock) {
  DeviceState state = device_at(0.10, 1.001);
  state.linear_velocity.x() = 0.1;
  EXPECT_NEAR(peer_x_m(state, 0.02), 0.12, 0.002);
}

TEST(PeerForecast, TurnsOn) {
  PeerForecast forecast;
  DeviceState state;
  state.angular_velocity = {0, 0, 2};
  forecast.observe(state);
  DevicePose device;
  forecast.advance(device, 0.1, 0.5);
  EXPECT_NEAR(2.0 * std::asin(device.pose.orientation.z()), 0.4, 1e-3) << "0.2 s of the device's time";
  EXPECT_NEAR(device.angular_velocity.z(), 4.0, 1e-12) << "in simulated time";
}

}  // namespace
}  // namespace subworld
