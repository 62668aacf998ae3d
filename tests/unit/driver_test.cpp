#include "device_sim/driven_device.hpp"
#include "device_sim/driver_check.hpp"
#include "device_sim/drivers.hpp"
#include "model/error.hpp"
#include "support/udp_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
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

}  // namespace
}  // namespace subworld
