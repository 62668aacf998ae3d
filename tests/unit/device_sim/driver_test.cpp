#include "device_sim/command_check.hpp"
#include "device_sim/driven_device.hpp"
#include "device_sim/driver_check.hpp"
#include "device_sim/drivers.hpp"
#include "device_sim/drivers/joystick_force.hpp"
#include "model/error.hpp"
#include "support/udp_device.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace subworld {
namespace {

const DriverPlugin& faulty() {
  setenv("SUBWORLD_DEVICES", TEST_DEVICES_FOLDER, 1);
  return driver_plugin("faulty");
}

// A sub-world that was halted for seconds answers a state from before the halt.
TEST(CommandCheck, AcceptsTheAnswerToAStateThatItHasForgotten) {
  CommandCheck check;
  for (std::uint64_t n = 1; n <= 5000; ++n) check.sent(n, static_cast<std::int64_t>(n) * 1'000'000);
  DeviceCommand command;
  command.sequence = 100;
  command.echoed_sent_ns = 100'000'000;
  EXPECT_TRUE(check.possible(command));
  command.sequence = 4990;
  EXPECT_FALSE(check.possible(command)) << "this state was sent at another time";
  command.echoed_sent_ns = 4'990'000'000;
  EXPECT_TRUE(check.possible(command));
  command.sequence = 100;
  EXPECT_FALSE(check.possible(command)) << "older than the last one";
}

TEST(CommandCheck, AcceptsWhatAnswersAStateOfThisDeviceAndNothingElse) {
  CommandCheck check;
  const auto possible = [&](std::uint64_t sequence, std::int64_t echoed_ns) {
    DeviceCommand command;
    command.sequence = sequence;
    command.echoed_sent_ns = echoed_ns;
    return check.possible(command);
  };
  for (std::uint64_t n = 1; n <= 5000; ++n) check.sent(n, static_cast<std::int64_t>(1000 * n));
  EXPECT_TRUE(possible(4990, 4'990'000));
  EXPECT_TRUE(possible(4990, 4'990'000)) << "the haptic step is shorter than the device's period";
  EXPECT_TRUE(possible(4991, 0)) << "of an extrapolated state";
  EXPECT_FALSE(possible(4990, 4'990'000)) << "the sequence goes back";
  EXPECT_FALSE(possible(4992, 4'992'001)) << "no state was sent at that time";
  EXPECT_FALSE(possible(5001, 0)) << "that state is yet to come";
  EXPECT_FALSE(possible(4992, 4'993'000)) << "of another state";
  EXPECT_TRUE(possible(4992, 4'992'000)) << "the haptic process goes on";
  check.sent(5000, 5'000'500);  // the same reading again
  EXPECT_TRUE(possible(5000, 5'000'000));
  EXPECT_TRUE(possible(5000, 5'000'500));
}

/// Names of the properties that a driver lacks.
std::vector<std::string> missed(const std::string& fault) {
  std::vector<std::string> names;
  for (const DriverProperty& one : check_driver(faulty(), {.settings = fault, .duration_s = 0.8})) {
    if (!one.held) names.push_back(one.name);
  }
  return names;
}

struct Fault {
  const char* settings;
  const char* property;  ///< the one that must be missed
};

class DriverCheck : public ::testing::TestWithParam<Fault> {};

TEST_P(DriverCheck, FindsTheFault) {
  const auto names = missed(GetParam().settings);
  EXPECT_NE(std::ranges::find(names, std::string(GetParam().property)), names.end())
      << names.size() << " others are missed, the first is " << (names.empty() ? "none" : names.front());
}

INSTANTIATE_TEST_SUITE_P(
    Faults, DriverCheck,
    ::testing::Values(Fault{"opens_never", "no call throws"}, Fault{"dof", "capabilities are valid"},
                      Fault{"mute", "readings arrive"}, Fault{"blocks", "read() returns in time"},
                      Fault{"hangs", "every call returns"}, Fault{"throws", "no call throws"},
                      Fault{"throws_a_number", "no call throws"},
                      Fault{"slow", "readings come at the rate of the capabilities"},
                      Fault{"frozen", "the device was moved"}, Fault{"nan", "values are finite"},
                      Fault{"jumps", "no jumps: slower than 10 m/s"},
                      Fault{"millimetres", "positions are within the workspace, in metres"},
                      Fault{"quaternion", "orientations are unit quaternions"},
                      Fault{"backwards", "time does not run backwards"}, Fault{"milliseconds", "time is in seconds"},
                      Fault{"frozen_clock", "time is in seconds"},
                      Fault{"velocity", "velocities agree with the positions"}, Fault{"write_fails", "no call throws"},
                      Fault{"write_blocks", "write() returns in time"}, Fault{"close_fails", "no call throws"}),
    [](const auto& one) { return std::string(one.param.settings); });

// A busy machine may delay calls and readings: no other property may be missed.
TEST(DriverCheck, ASoundDriverHasAllProperties) {
  for (const std::string& name : missed("sound"))
    EXPECT_TRUE(name.find("time") < name.size() || name.find("rate") < name.size()) << name;
}

TEST(Drivers, AnUnknownOneIsNamedWithTheNearest) {
  (void)faulty();
  try {
    (void)driver_plugin("faulti");
    FAIL() << "it is unknown";
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::usage);
    for (const char* word : {"faulti", "did you mean faulty?", "emulated", "SUBWORLD_DEVICES"})
      EXPECT_NE(std::string(wrong.what()).find(word), std::string::npos) << word << ": " << wrong.what();
  }
}

/// Steps at 1 kHz until `condition`, at most 5 s.
template <class Condition>
bool step_until(DrivenDevice& device, Condition condition) {
  for (int i = 0; i < 5000; ++i) {
    device.step({}, 1e-3);
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

TEST(DrivenDevice, BeginsAtItsFirstReadingWithTheScale) {
  DrivenDevice device(faulty(), {.settings = "sound", .scale_ratio = 2.0}, {}, 0);
  EXPECT_TRUE(device.present());
  EXPECT_EQ(device.state().pose.position, Vec3(Vec3::Zero()));
  // The circle of 0.02 m is opposite its start after half a turn.
  double furthest_m = 0.0;
  (void)step_until(device, [&] {
    furthest_m = std::max(furthest_m, device.state().pose.position.norm());
    return device.state().stamp_s > 0.7;
  });
  EXPECT_NEAR(furthest_m, 2.0 * 0.04, 0.004);
  EXPECT_EQ(device.result().refused, 0U) << device.result().refused_for;
}

class LostDevice : public ::testing::TestWithParam<const char*> {};

TEST_P(LostDevice, IsAbsentAndSaysSo) {
  DrivenDevice device(faulty(), {.settings = GetParam()}, {}, 0);
  ASSERT_TRUE(step_until(device, [&] { return !device.present(); }));
  EXPECT_EQ(device.state().linear_velocity, Vec3(Vec3::Zero()));
  EXPECT_NE(device.news().find("the force has faded"), std::string::npos);
  EXPECT_TRUE(device.state().pose.position.allFinite());
  EXPECT_EQ(device.result().absences, 1U);
}

// hangs: the loop above goes on although the driver does not return.
INSTANTIATE_TEST_SUITE_P(Faults, LostDevice, ::testing::Values("throws", "throws_a_number", "nan", "hangs", "blocks"),
                         [](const auto& one) { return std::string(one.param); });

TEST(DrivenDevice, ThatWasLostIsOpenedAgainAndReturnsLate) {
  DrivenDevice device(faulty(), {.settings = "throws"}, {}, 0);
  ASSERT_TRUE(step_until(device, [&] { return !device.present(); }));
  const double lost_s = device.state().stamp_s;
  ASSERT_TRUE(step_until(device, [&] { return device.present(); }));
  // By then haptic_sim counts it as absent too, and restarts the coupling where it is.
  EXPECT_GT(device.state().stamp_s - lost_s, kAbsent_s);
  EXPECT_NE(device.news().find("the force rises from zero"), std::string::npos);
}

/// Steps with a force along x for some time; returns all news. `seen`: called after each step.
std::string push(
    DrivenDevice& device, double force_n, double duration_s, const std::function<void()>& seen = [] {}) {
  std::string news;
  DeviceCommand command;
  command.wrench.force.x() = force_n;
  for (const double end_s = device.state().stamp_s + duration_s; device.state().stamp_s < end_s;) {
    device.step(command, 1e-3);
    seen();
    news += device.news();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return news;
}

// The driver refuses each force that may not leave, and reports the newest one as its buttons, in 0.1 N.
TEST(DrivenDevice, GetsAForceThatIsFiniteBoundedAndRises) {
  DrivenDevice device(faulty(), {.settings = "strict"}, {}, 0);
  std::string news = push(device, std::numeric_limits<double>::quiet_NaN(), 0.05);
  EXPECT_EQ(device.state().buttons, 0U);
  news += push(device, std::numeric_limits<double>::infinity(), 0.05);
  EXPECT_EQ(device.state().buttons, 0U);
  news += push(device, 1e9, 0.1);
  EXPECT_GE(device.state().buttons, 99U) << "the limit of the device";
  news += push(device, std::numeric_limits<double>::quiet_NaN(), 0.05);
  news += push(device, 8.0, 0.1);
  EXPECT_EQ(device.state().buttons, 80U);
  EXPECT_EQ(news.find("forbidden"), std::string::npos) << news;
}

TEST(DrivenDevice, GetsNoForceWhileTheLoopIsHalted) {
  DrivenDevice device(faulty(), {.settings = "strict"}, {}, 0);
  std::string news = push(device, 8.0, 0.1);
  EXPECT_EQ(device.state().buttons, 80U);
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  device.step({}, 1e-3);
  EXPECT_EQ(device.state().buttons, 0U);
  news += push(device, 8.0, 0.1);
  EXPECT_EQ(device.state().buttons, 80U);
  EXPECT_EQ(news.find("forbidden"), std::string::npos) << news;
}

class Interrupted : public ::testing::TestWithParam<const char*> {};

TEST_P(Interrupted, ADriverGetsItsForceFromZeroAgain) {
  DrivenDevice device(faulty(), {.settings = GetParam()}, {}, 0);
  const std::string news = push(device, 8.0, 2.2);
  EXPECT_NE(news.find("the force has faded"), std::string::npos) << news;
  EXPECT_NE(news.find("the force rises from zero"), std::string::npos) << news;
  EXPECT_EQ(news.find("forbidden"), std::string::npos) << news;
}

INSTANTIATE_TEST_SUITE_P(Faults, Interrupted, ::testing::Values("strict_blocks", "strict_throws"),
                         [](const auto& one) { return std::string(one.param); });

TEST(DrivenDevice, RestsWhileDeclutchedAndGoesOnFromThere) {
  DrivenDevice device(faulty(), {.settings = "button", .declutch_button = 2}, {}, 0);
  Vec3 rested = Vec3::Zero(), after = Vec3::Zero();
  bool was_pressed = false, is_released = false;
  (void)push(device, 0.0, 0.9, [&] {
    const bool pressed = (device.state().buttons & 4U) != 0;
    EXPECT_EQ(device.renders_force(), !pressed);
    if (pressed) {
      if (was_pressed) {
        EXPECT_EQ(device.state().pose.position, rested);
      }
      EXPECT_EQ(device.state().linear_velocity, Vec3(Vec3::Zero()));
      rested = device.state().pose.position;
      was_pressed = true;
    } else if (was_pressed && !is_released) {
      after = device.state().pose.position;
      is_released = true;
    }
  });
  ASSERT_TRUE(is_released);
  EXPECT_GT(rested.norm(), 0.01);
  EXPECT_LT((after - rested).norm(), 0.01) << "meanwhile the handle has moved by 0.03 m";
  EXPECT_GT((device.state().pose.position - rested).norm(), 0.01) << "it does not go on";
}

TEST(DrivenDevice, WithoutAReadingIsAnErrorThatNamesTheFault) {
  for (const auto& [settings, word] : {std::pair{"opens_never", "no such device"},
                                       {"mute", "reads nothing"},
                                       {"millimetres", "metres"},
                                       {"quaternion", "unit quaternion"}}) {
    try {
      const DrivenDevice device(faulty(), {.settings = settings, .wait_s = 0.3}, {}, 0);
      ADD_FAILURE() << settings;
    } catch (const Error& wrong) {
      EXPECT_NE(std::string(wrong.what()).find(word), std::string::npos) << wrong.what();
    }
  }
}

TEST(DrivenDevice, DoesNotWaitWhereItsSettingsAreWrong) {
  (void)faulty();
  const TimePoint begin = Clock::now();
  try {
    const DrivenDevice device(driver_plugin("udp"), {.settings = "prot=1"}, {}, 0);
    ADD_FAILURE() << "opened";
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::usage);
    EXPECT_NE(std::string(wrong.what()).find("setting prot is unknown; it takes: address="), std::string::npos)
        << wrong.what();
  }
  EXPECT_LT(to_seconds(Clock::now() - begin), 10.0) << "without an error it would wait for 30 s";
}

TEST(DrivenDevice, LimitsTheSceneToWhatItShows) {
  const DriverCapabilities weak{.degrees_of_freedom = 3, .force_limit_n = 5.0, .torque_limit_n_m = 0.0};
  DeviceSpec spec;
  const DeviceSpec limited = within_limits(spec, weak, "weak");
  EXPECT_EQ(limited.force_limit_n, 5.0);
  EXPECT_EQ(limited.torque_limit_n_m, 0.0);
  EXPECT_EQ(*limited.power_limit_w, 5.0);
  spec.degrees_of_freedom = 6;
  EXPECT_THROW((void)within_limits(spec, weak, "weak"), Error);
  spec.degrees_of_freedom = 3;
  spec.kind = DeviceKind::admittance;
  EXPECT_THROW((void)within_limits(spec, weak, "weak"), Error);
}

// Whatever arrives at the port of the driver udp.
TEST(UdpDriver, ServesOneSenderAndIgnoresWhatIsNoPose) {
  constexpr int kPort = 47899;
  (void)faulty();
  test::UdpPeer peer(kPort), second(kPort);
  const std::unique_ptr<DeviceDriver> driver = driver_plugin("udp").make();
  (void)driver->open({"port=47899", 0});
  DriverReading reading;
  const std::array<char, 200> long_one{'S', 'W', 'P', '1'};
  std::array<char, 128> other_mark{'S', 'W', 'W', '1'};
  for (std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{127}, std::size_t{200}})
    peer.send_bytes(long_one.data(), size);
  peer.send_bytes(other_mark.data(), other_mark.size());
  EXPECT_FALSE(driver->read(reading)) << "it is no pose";

  peer.send_pose(7, 1.0, {0.1, 0.2, 0.3});
  ASSERT_TRUE(driver->read(reading));
  EXPECT_EQ(reading.time_s, 1.0);
  EXPECT_EQ(reading.position_m, (std::array<double, 3>{0.1, 0.2, 0.3}));
  peer.send_pose(7, 1.1, {0.0, 0.0, 0.0});
  peer.send_pose(6, 1.1, {0.0, 0.0, 0.0});
  EXPECT_FALSE(driver->read(reading)) << "it is not newer";
  second.send_pose(8, 1.2, {0.9, 0.0, 0.0});
  EXPECT_FALSE(driver->read(reading)) << "another sender";

  driver->write({.force_n = {1.0, 2.0, 3.0}, .torque_n_m = {}});
  std::array<double, 3> force_n{};
  EXPECT_TRUE(peer.receive(force_n));
  EXPECT_EQ(force_n, (std::array<double, 3>{1.0, 2.0, 3.0}));
  EXPECT_FALSE(second.receive(force_n));

  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  second.send_pose(1, 0.0, {0.5, 0.0, 0.0});
  EXPECT_TRUE(driver->read(reading)) << "the first one has gone";
  driver->close();
}

TEST(UdpDriver, RefusesSettingsThatItDoesNotKnow) {
  (void)faulty();
  for (const char* settings : {"prot=1", "port=none", "port=0", "address=nowhere", "port"}) {
    const std::unique_ptr<DeviceDriver> driver = driver_plugin("udp").make();
    EXPECT_THROW((void)driver->open({settings, 0}), std::exception) << settings;
    driver->close();
  }
}

TEST(JoystickDriver, TurnsAnAxisIntoAPositionAndAForceIntoAnEffect) {
  EXPECT_EQ(axis_position_m(-100, -100, 300, 0.1), -0.1);
  EXPECT_EQ(axis_position_m(300, -100, 300, 0.1), 0.1);
  EXPECT_NEAR(axis_position_m(100, -100, 300, 0.1), 0.0, 1e-12);
  EXPECT_EQ(axis_position_m(900, -100, 300, 0.1), 0.1);
  EXPECT_EQ(axis_position_m(1, 5, 5, 0.1), 0.0) << "an axis without a range";
  const auto direction = [](double x_n, double y_n) { return constant_force({x_n, y_n, 0.0}, 2.0, -1).direction; };
  EXPECT_EQ(direction(0.0, -1.0), 0x0000) << "towards the operator";
  EXPECT_EQ(direction(-1.0, 0.0), 0x4000) << "left";
  EXPECT_EQ(direction(0.0, 1.0), 0x8000) << "away";
  EXPECT_EQ(direction(1.0, 0.0), 0xC000) << "right";
  const ff_effect effect = constant_force({0.0, 1.0, 5.0}, 2.0, 3);
  EXPECT_EQ(effect.type, FF_CONSTANT);
  EXPECT_EQ(effect.id, 3);
  EXPECT_EQ(effect.u.constant.level, 0x4000);
  EXPECT_EQ(effect.replay.length, 0) << "it has no end";
  EXPECT_EQ(constant_force({9.0, 0.0, 0.0}, 2.0, 3).u.constant.level, 0x7fff);
  EXPECT_EQ(constant_force({}, 2.0, 3).u.constant.level, 0);
}

TEST(JoystickDriver, SaysWhichFileIsNoEventDevice) {
  (void)faulty();
  for (const auto& [settings, word] :
       {std::pair{"path=/nowhere", "/nowhere: open"}, {"path=/dev/null", "/dev/null: is no event device"}}) {
    const std::unique_ptr<DeviceDriver> driver = driver_plugin("joystick").make();
    try {
      (void)driver->open({settings, 0});
      ADD_FAILURE() << settings;
    } catch (const std::exception& wrong) {
      EXPECT_NE(std::string(wrong.what()).find(word), std::string::npos) << wrong.what();
    }
    driver->close();
  }
}

// Protocol of spacenavd: eight integers an event, motion 0, x, y, z, rx, ry, rz, period, press 1 and release 2.
class SpaceMouse : public ::testing::Test {
 protected:
  void SetUp() override {
    (void)faulty();
    ASSERT_EQ(std::ranges::count(driver_names(), "spacemouse"), 1) << "this build has no libspnav";
    const std::string path = ::testing::TempDir() + "spnav_" + std::to_string(getpid());
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    path.copy(own.sun_path, sizeof own.sun_path - 1);
    setenv("SPNAV_SOCKET", path.c_str(), 1);
    unlink(path.c_str());
    ASSERT_EQ(bind(daemon_, reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
    ASSERT_EQ(listen(daemon_, 1), 0);
    driver_ = driver_plugin("spacemouse").make();
    (void)driver_->open({"speed_m_s=0.2 turn_rad_s=2", 0});
    link_ = accept(daemon_, nullptr, nullptr);
    unlink(path.c_str());
  }
  void TearDown() override {
    close(link_);
    close(daemon_);
  }
  void send(const std::array<std::int32_t, 8>& event) const {
    ASSERT_EQ(write(link_, event.data(), sizeof event), static_cast<ssize_t>(sizeof event));
  }
  [[nodiscard]] DriverReading read() const {
    DriverReading reading;
    EXPECT_TRUE(driver_->read(reading));
    return reading;
  }

  int daemon_ = socket(AF_UNIX, SOCK_STREAM, 0), link_ = -1;
  std::unique_ptr<DeviceDriver> driver_;
};

TEST_F(SpaceMouse, MovesByItsDeflection) {
  send({0, 350, 175, 0, 35, 70, 350, 8});
  send({1, 3, 0, 0, 0, 0, 0, 0});
  const DriverReading before = read();
  EXPECT_EQ(before.linear_velocity_m_s, (std::array<double, 3>{0.2, 0.0, 0.1}));
  const std::array<double, 3> turn_rad_s{0.2, 2.0, 0.4};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(before.angular_velocity_rad_s[i], turn_rad_s[i], 1e-12);
  EXPECT_EQ(before.buttons, 8U);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const DriverReading after = read();
  const double passed_s = after.time_s - before.time_s;
  EXPECT_NEAR(after.position_m[0] - before.position_m[0], 0.2 * passed_s, 1e-9);
  EXPECT_NEAR(after.position_m[2] - before.position_m[2], 0.1 * passed_s, 1e-9);
  EXPECT_GT(after.orientation[2], before.orientation[2]);
  EXPECT_EQ(judge(after, &before, {.degrees_of_freedom = 6, .workspace_m = 0.5, .rate_hz = 250.0}), ReadingFault::none);
  send({0, 0, 0, 0, 0, 0, 0, 8});
  send({2, 3, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(read().linear_velocity_m_s, (std::array<double, 3>{}));
  EXPECT_EQ(read().buttons, 0U);
  driver_->close();
}

TEST_F(SpaceMouse, IsLostWithItsDaemon) {
  (void)read();
  close(link_);
  DriverReading reading;
  EXPECT_THROW((void)driver_->read(reading), std::exception);
  driver_->close();
}

}  // namespace
}  // namespace subworld
