#include "device_sim/drivers/browser_tool.hpp"
#include "device_sim/drivers/pose_socket.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

namespace subworld {
namespace {

constexpr double kDt_s = 1e-3;

PoseDatagram pose_at(double x_m, double y_m = 0.0) {
  PoseDatagram pose{};
  pose.position_m[0] = x_m;
  pose.position_m[1] = y_m;
  pose.orientation[0] = 1.0;
  return pose;
}

/// A tool that is read each millisecond.
struct Read {
  BrowserTool tool{1.0};
  double now_s = 0.0;
  DriverReading reading;

  bool step() {
    now_s += kDt_s;
    return tool.read(now_s, reading);
  }
  /// Takes the tool and holds it there, with a pose each 16 ms.
  void hold(double x_m, int steps) {
    for (int i = 0; i < steps; ++i) {
      if (i % 16 == 0) tool.receive(pose_at(x_m), now_s);
      EXPECT_TRUE(step());
    }
  }
};

TEST(BrowserTool, RestsUntilAPageTakesIt) {
  Read one;
  for (int i = 0; i < 2000; ++i) {
    ASSERT_TRUE(one.step());
    EXPECT_EQ(one.reading.position_m, (std::array<double, 3>{}));
    EXPECT_EQ(one.reading.linear_velocity_m_s, (std::array<double, 3>{}));
    EXPECT_EQ(one.reading.time_s, one.now_s);
  }
}

// Poses of a page at 60 Hz, each up to 4 ms early or late.
TEST(BrowserTool, FollowsASinusoidWithTheKnownLag) {
  constexpr double kAmplitude_m = 0.05, kRate_rad_s = M_PI, kInterval_s = 1.0 / 60.0;
  const double lag_s = PoseTracking::kLag_s + 0.5 * kInterval_s;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> jitter(-0.004, 0.004);
  Read one;
  const auto path = [&](double t) { return kAmplitude_m * std::sin(kRate_rad_s * t); };
  double next_s = 0.0, square = 0.0, worst_m = 0.0, velocity_worst_m_s = 0.0;
  int count = 0;
  for (int k = 1; one.now_s < 6.0;) {
    if (one.now_s >= next_s) {
      one.tool.receive(pose_at(path(one.now_s)), one.now_s);
      next_s = kInterval_s * k++ + jitter(random);
    }
    const double before_m = one.reading.position_m[0];
    ASSERT_TRUE(one.step());
    velocity_worst_m_s = std::max(velocity_worst_m_s, std::abs((one.reading.position_m[0] - before_m) / kDt_s -
                                                               one.reading.linear_velocity_m_s[0]));
    if (one.now_s < 1.0) continue;
    const double error_m = one.reading.position_m[0] - path(one.now_s - lag_s);
    worst_m = std::max(worst_m, std::abs(error_m));
    square += error_m * error_m;
    ++count;
  }
  EXPECT_LT(worst_m, 0.03 * kAmplitude_m);
  EXPECT_LT(std::sqrt(square / count), 0.01 * kAmplitude_m);
  EXPECT_LT(velocity_worst_m_s, 1e-9) << "the velocity is that of the positions";
}

TEST(BrowserTool, ItsSpeedAndAccelerationAreBoundedWhateverAPageSends) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> anywhere(-1.0, 1.0);
  Read one;
  std::array<double, 3> before{};
  for (int i = 0; i < 20000; ++i) {
    if (i % 40 == 0) {
      PoseDatagram pose = pose_at(anywhere(random), anywhere(random));
      const double angle = M_PI * anywhere(random);
      pose.orientation[0] = std::cos(0.5 * angle);
      pose.orientation[3] = std::sin(0.5 * angle);
      one.tool.receive(pose, one.now_s);
    }
    ASSERT_TRUE(one.step());
    const auto& v = one.reading.linear_velocity_m_s;
    EXPECT_LE(std::hypot(v[0], v[1], v[2]), PoseTracking::kSpeed_m_s * (1.0 + 1e-9));
    EXPECT_LE(std::hypot(v[0] - before[0], v[1] - before[1], v[2] - before[2]),
              PoseTracking::kAcceleration_m_s2 * kDt_s * (1.0 + 1e-9));
    EXPECT_LE(std::abs(one.reading.angular_velocity_rad_s[2]), PoseTracking::kTurn_rad_s * (1.0 + 1e-9));
    before = v;
  }
}

TEST(BrowserTool, DoesNotRunPastItsAim) {
  Read one;
  one.hold(0.0, 100);
  for (int i = 0; i < 1500; ++i) {
    if (i % 16 == 0) one.tool.receive(pose_at(0.7), one.now_s);
    ASSERT_TRUE(one.step());
    EXPECT_LE(one.reading.position_m[0], 0.7 + 1e-6);
  }
  EXPECT_NEAR(one.reading.position_m[0], 0.7, 1e-4);
}

TEST(BrowserTool, StaysInItsWorkspace) {
  Read one;
  one.hold(0.0, 100);
  one.hold(1.9, 4000);
  EXPECT_NEAR(one.reading.position_m[0], 1.0, 1e-3);
}

TEST(BrowserTool, APageThatSendsNoPoseHoldsItNoMore) {
  Read one;
  one.hold(0.2, 1);
  one.hold(0.25, 500);
  const double quiet_from_s = one.now_s;
  while (one.step()) ASSERT_LT(one.now_s, quiet_from_s + 1.0);
  EXPECT_NEAR(one.now_s - quiet_from_s, BrowserTool::kQuiet_s, 0.02);
  EXPECT_FALSE(one.tool.held());
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(one.step());
}

TEST(BrowserTool, GoesOnFromWhereItIsForTheNextPage) {
  Read one;
  one.hold(0.2, 1);
  one.hold(0.25, 500);
  EXPECT_NEAR(one.reading.position_m[0], 0.05, 1e-4) << "poses count from where it was taken";
  PoseDatagram release{};
  release.flags = kReleased;
  one.tool.receive(release, one.now_s);
  EXPECT_FALSE(one.step()) << "at once";
  for (int i = 0; i < 5000; ++i) (void)one.step();
  one.hold(-0.7, 100);
  EXPECT_NEAR(one.reading.position_m[0], 0.05, 1e-4);
  one.hold(-0.75, 500);
  EXPECT_NEAR(one.reading.position_m[0], 0.0, 1e-4);
}

TEST(BrowserTool, RefusesNonsense) {
  Read one;
  one.hold(0.0, 200);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    one.tool.receive(pose_at(bad), one.now_s);
    PoseDatagram turned = pose_at(0.5);
    turned.orientation[2] = bad;
    one.tool.receive(turned, one.now_s);
  }
  PoseDatagram longer = pose_at(0.5);
  longer.orientation[0] = 2.0;
  one.tool.receive(longer, one.now_s);
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(one.step());
    EXPECT_EQ(one.reading.position_m[0], 0.0);
  }
}

/// Sends a pose as a user of this machine; false: not allowed to be that user.
bool send_as(uid_t user, const LocalAddress& to, std::uint32_t number) {
  const pid_t child = fork();
  if (child == 0) {
    PoseDatagram pose = pose_at(0.1);
    pose.mark = kPoseMark;
    pose.number = number;
    const int from = socket(AF_UNIX, SOCK_DGRAM, 0);
    const bool sent = (user == geteuid() || setuid(user) == 0) &&
                      sendto(from, &pose, sizeof pose, 0, to.get(), to.size) == sizeof pose;
    _exit(sent ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status == 0;
}

TEST(PoseSocket, TakesThePosesOfItsOwnUserOnly) {
  const LocalAddress address = tool_address(getpid(), 0);
  PoseSocket tool;
  tool.open(address.get(), address.size, "the test's tool");
  const auto reads = [&] { return tool.read([](const PoseDatagram&) {}); };
  constexpr uid_t kNobody = 65534;
  if (send_as(kNobody, address, 1)) {
    EXPECT_FALSE(reads()) << "of another user";
  }
  ASSERT_TRUE(send_as(geteuid(), address, 2));
  EXPECT_TRUE(reads());
}

}  // namespace
}  // namespace subworld
