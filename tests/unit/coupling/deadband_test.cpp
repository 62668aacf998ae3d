// The deadband of a device's link.
#include "coupling/messages/deadband.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace subworld {
namespace {

constexpr double kPeriod_s = 0.001;

UserSpec user_of(DeviceKind kind) {
  UserSpec user;
  user.device.kind = kind;
  user.coupling = {.stiffness_n_m = 1000.0, .damping_n_s_m = 20.0};
  return user;
}

DeviceState moving(double t_s) {
  DeviceState state;
  state.sequence = static_cast<std::uint64_t>(t_s / kPeriod_s + 0.5);
  state.stamp_s = t_s;
  state.pose.position.x() = 0.02 * std::sin(20.0 * t_s);
  state.linear_velocity.x() = 0.4 * std::cos(20.0 * t_s);
  return state;
}

TEST(Deadband, of_nothing_sends_everything) {
  const UserSpec user = user_of(DeviceKind::impedance);
  Deadband<DeviceState> off(0.0, user);
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(off.sends(DeviceState{}, {}, kPeriod_s));
  EXPECT_EQ(off.sent_ratio(), 1.0);
}

TEST(Deadband, a_motion_is_sent_where_the_receiver_would_be_wrong_by_more_than_the_fraction) {
  const UserSpec user = user_of(DeviceKind::impedance);
  const Wrench felt{{0.0, 0.0, 2.0}, Vec3::Zero()};
  double before = 1.1;
  for (const double fraction : {0.05, 0.1, 0.2}) {
    Deadband<DeviceState> deadband(fraction, user);
    for (int i = 0; i < 2000; ++i) {
      const DeviceState now = moving(i * kPeriod_s);
      const DeviceState there = deadband.pass(now, felt, kPeriod_s);
      const double error_n = 1000.0 * (now.pose.position - there.pose.position).norm() +
                             20.0 * (now.linear_velocity - there.linear_velocity).norm();
      ASSERT_LE(error_n, fraction * 2.0) << "step " << i;
      ASSERT_EQ(there.sequence, now.sequence);
      ASSERT_EQ(there.stamp_s, now.stamp_s);
    }
    EXPECT_LT(deadband.sent_ratio(), before) << fraction;
    before = deadband.sent_ratio();
  }
  EXPECT_LT(before, 0.5);
}

TEST(Deadband, a_force_is_sent_where_it_differs_by_more_than_the_fraction) {
  const UserSpec user = user_of(DeviceKind::impedance);
  Deadband<DeviceCommand> deadband(0.1, user);
  DeviceCommand command;
  const auto sends = [&](double force_n) {
    command.wrench.force.x() = force_n;
    return deadband.sends(command, command.wrench, kPeriod_s);
  };
  EXPECT_TRUE(sends(10.0));
  EXPECT_FALSE(sends(10.9));
  EXPECT_FALSE(sends(9.2));
  EXPECT_TRUE(sends(8.9));
  EXPECT_FALSE(sends(8.9));
  EXPECT_TRUE(sends(0.0)) << "the operator must not feel a force that has ended";
  EXPECT_FALSE(sends(0.04)) << "weaker than what can be felt";
}

TEST(Deadband, a_sender_at_rest_is_heard_of) {
  const UserSpec user = user_of(DeviceKind::impedance);
  Deadband<DeviceState> deadband(0.27, user);
  int absent = 0, longest = 0;
  for (int i = 0; i < 1000; ++i) {
    absent = deadband.sends(DeviceState{}, {}, kPeriod_s) ? 0 : absent + 1;
    longest = std::max(longest, absent);
  }
  EXPECT_GT(longest, 2);
  EXPECT_LT(longest * kPeriod_s, kLongestAbsence_s);
}

TEST(Deadband, of_an_admittance_device_is_of_the_operators_force_and_the_commanded_motion) {
  const UserSpec user = user_of(DeviceKind::admittance);
  Deadband<DeviceState> states(0.1, user);
  DeviceState state;
  state.applied.force.x() = 5.0;
  EXPECT_TRUE(states.sends(state, state.applied, kPeriod_s));
  state.pose.position.x() = 1.0;
  EXPECT_FALSE(states.sends(state, state.applied, kPeriod_s)) << "its receiver has no use for the pose";
  state.applied.force.x() = 6.0;
  EXPECT_TRUE(states.sends(state, state.applied, kPeriod_s));
  Deadband<DeviceCommand> commands(0.1, user);
  DeviceCommand command;
  EXPECT_TRUE(commands.sends(command, {}, kPeriod_s));
  command.pose.position.x() = 0.001;
  EXPECT_TRUE(commands.sends(command, {}, kPeriod_s));
}

}  // namespace
}  // namespace subworld
