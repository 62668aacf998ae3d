// Where a peer's device is by now: movements of an arm, with and without noise, and velocities that jump.
#include "haptic_sim/peer_forecast.hpp"
#include "model/scene/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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
