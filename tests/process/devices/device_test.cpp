#include "process/process_test.hpp"

#include "support/udp_device.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>

namespace subworld::test {
namespace {

constexpr double kPressed_m = 0.05;  // by the path of the scene press

class Devices : public ProcessTest {
 protected:
  /// No other test on this machine uses it, as its domain.
  [[nodiscard]] int port() const { return 47900 + domain_.number(); }
  [[nodiscard]] std::string settings() const { return "port=" + std::to_string(port()) + " velocity=0"; }

  /// The device has taken part in the run for a second.
  [[nodiscard]] bool runs() const {
    return eventually([&] { return read_table(out() + "/device_0.csv").rows.size() > 1000; });
  }
  /// Stops a run a little later, so that its histories have what was seen last.
  [[nodiscard]] static Ended stop(Process& process) {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    process.signal(SIGTERM);
    const auto code = process.wait();
    return {code.value_or(-1), process.out(), process.err()};
  }
  [[nodiscard]] Words words_of(const std::string& device, const std::string& driver_settings,
                               const std::string& duration_s = "1000") const {
    return run_words(scene("press"), {"--mode", "realtime", "--duration", duration_s, "--device", device,
                                      "--device-settings", driver_settings});
  }
};

/// A column of the history of a device.
std::vector<double> column_of(const Table& table, const char* name) {
  const std::size_t x = table.column(name);
  std::vector<double> values;
  for (const auto& row : table.rows) values.push_back(row[x]);
  return values;
}

double mean_between(const Table& table, double from_s, double to_s) {
  const std::size_t x = table.column("force_x_n");
  double sum = 0.0;
  int count = 0;
  for (const auto& row : table.rows) {
    if (row[0] < from_s || row[0] > to_s) continue;
    sum += row[x];
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

TEST_F(Devices, ByUdpFeelsTheForceOfTheEmulatedDevice) {
  const Ended emulated = run(scene("press"), {"--mode", "realtime", "--duration", "1.2"});
  ASSERT_EQ(emulated.code, 0) << emulated.err;
  const double expected_n = mean_between(read_table(out() + "/device_0.csv"), 0.9, 1.1);
  ASSERT_LT(expected_n, -10.0);
  std::filesystem::remove_all(out());  // runs() reads the history of the next run

  UdpDevice device(port());
  Process process(words_of("udp", settings()), folder_.path());
  ASSERT_TRUE(runs());
  device.move_to(kPressed_m, 0.4);
  const auto equal = [&] { return std::abs(device.force_x_n() - expected_n) < 0.05 * std::abs(expected_n); };
  EXPECT_TRUE(eventually(equal, 3.0)) << device.force_x_n() << " N, the emulated one " << expected_n << " N";
  const Ended ended = stop(process);
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["device"][0]["driver"]["name"], "udp");
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
}

TEST_F(Devices, UnpluggedHasNoForceWithin5MsAndReturnsWithARamp) {
  UdpDevice device(port());
  Process process(words_of("udp", settings()), folder_.path());
  ASSERT_TRUE(runs());
  device.move_to(kPressed_m, 0.4);
  EXPECT_TRUE(eventually([&] { return device.force_x_n() < -15.0; }, 2.0));
  device.unplug(true);
  EXPECT_TRUE(eventually([&] { return device.force_x_n() == 0.0; }, 2.0));
  // It comes back 0.1 m from where it was lost: without the declutch, that is 100 N of the coupling.
  device.place(kPressed_m, 0.1);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  device.unplug(false);
  EXPECT_TRUE(eventually([&] { return device.force_x_n() < -15.0; }, 3.0));
  const Ended ended = stop(process);
  EXPECT_EQ(ended.code, 0) << ended.err;

  const Table history = read_table(out() + "/device_0.csv");
  const std::vector<double> force = column_of(history, "force_x_n"), t_s = column_of(history, "time_s");
  std::size_t fades = 7;  // the first step in which the pressed device's force is zero
  while (fades < force.size() && !(force[fades] == 0.0 && force[fades - 7] < -15.0)) ++fades;
  ASSERT_LT(fades, force.size()) << "it did not fade within 5 ms";
  std::size_t rises = fades;
  while (rises < force.size() && force[rises] == 0.0) ++rises;
  EXPECT_GT(rises - fades, 250U) << "it returned before haptic_sim had noticed that it was absent";
  ASSERT_LT(rises + 100, force.size());
  for (std::size_t i = rises; i < rises + 100; ++i) {
    const double passed_ms = std::max(1.0, 1e3 * (t_s[i] - t_s[i - 1]));  // more where the OS took steps away
    EXPECT_LE(std::abs(force[i] - force[i - 1]), 3.0 * passed_ms) << "the force does not rise slowly";
    EXPECT_LE(std::abs(force[i]), 30.0) << "the coupling was stretched by the way of the absent device";
  }
  EXPECT_NE(ended.out.find("device udp of user 0 was absent "), std::string::npos) << ended.out;
  EXPECT_GE(summary()["device"][0]["driver"]["absences"], 1);
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
}

// A device of half the way: the scale and declutching bring its proxy to the same place.
TEST_F(Devices, AreMovedBackWithoutTheProxyWhileDeclutched) {
  UdpDevice device(port());
  Words words = words_of("udp", settings());
  words.insert(words.end(), {"--device-scale", "2", "--device-declutch", "0"});
  Process process(words, folder_.path());
  ASSERT_TRUE(runs());
  device.move_to(0.5 * kPressed_m, 0.4);
  EXPECT_TRUE(eventually([&] { return device.force_x_n() < -15.0; }, 2.0));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const double before_n = device.force_x_n();
  device.press(true);
  EXPECT_TRUE(eventually([&] { return device.force_x_n() == 0.0; }, 2.0));
  device.move_to(0.0, 0.4);
  EXPECT_EQ(device.force_x_n(), 0.0);
  device.press(false);
  EXPECT_TRUE(eventually([&] { return std::abs(device.force_x_n() - before_n) < 0.1 * std::abs(before_n); }, 2.0))
      << "the proxy was moved: " << device.force_x_n() << " N, before " << before_n << " N";
  const Ended ended = stop(process);
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
}

TEST_F(Devices, AreListedAndThoseThatAreNotThereHaveNoProperties) {
  const Ended listed = finish({program("subworld"), "device", "list"});
  for (const char* name : {"emulated: ", "udp: version 1", "joystick: version 1"})
    EXPECT_NE(listed.out.find(name), std::string::npos) << listed.out;
  const Ended checked =
      finish({program("subworld"), "device", "check", "joystick", "--device-settings", "path=/nowhere"});
  EXPECT_EQ(checked.code, 4) << checked.out;
  EXPECT_NE(checked.out.find("open(): /nowhere: open: No such file"), std::string::npos) << checked.out;
}

TEST_F(Devices, AreRefusedInLockStepAndByUnknownNames) {
  const Ended lockstep = run(scene("press"), {"--mode", "lockstep", "--device", "udp"});
  EXPECT_EQ(lockstep.code, 2);
  EXPECT_NE(lockstep.err.find("--mode realtime"), std::string::npos) << lockstep.err;
  const Ended unknown = run(scene("press"), {"--mode", "realtime", "--device", "udq"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("did you mean udp?"), std::string::npos) << unknown.err;
  const Ended few = run(scene("carry"), {"--mode", "realtime", "--device", "udp,emulated"});
  EXPECT_EQ(few.code, 2);
  EXPECT_NE(few.err.find("names no device for user 2"), std::string::npos) << few.err;
}

TEST_F(Devices, WithoutReadingsEndTheRunWithTheReason) {
  Words words = words_of("udp", settings(), "1");
  words.insert(words.end(), {"--wait", "0.5"});
  const Ended ended = finish(words);
  EXPECT_NE(ended.code, 0);
  EXPECT_NE((ended.out + ended.err + read_text(out() + "/logs/device_sim_0.log")).find("it is open, and reads nothing"),
            std::string::npos)
      << ended.err;
}

// The example of device_sim/README.md, built outside the tree with a stand-in of the SDK.
TEST_F(Devices, OfAnotherMakerAreBuiltOutsideTheTreeCheckedAndRun) {
  const std::string sdk = std::string(SOURCE_FOLDER) + "/tests/support/dhd", drivers = folder_.path() + "/drivers";
  std::filesystem::create_directories(drivers);
  const Ended library =
      finish({"/usr/bin/cc", "-shared", "-fPIC", sdk + "/dhdc.c", "-lm", "-o", drivers + "/libdhd.so"});
  ASSERT_EQ(library.code, 0) << library.err;
  const std::string example = std::string(SOURCE_FOLDER) + "/device_sim/example";
  const Ended built = finish({example + "/build", example + "/dhd.cpp", drivers, "-I" + sdk, "-L" + drivers, "-ldhd",
                              "-Wl,-rpath," + drivers});
  ASSERT_EQ(built.code, 0) << built.err;

  const Environment environment{{"SUBWORLD_DEVICES", drivers},
                                {"FAKE_DHD_FORCE", folder_.path() + "/force"},
                                {"FAKE_DHD_UNPLUGGED", folder_.path() + "/unplugged"}};
  const Ended listed = finish({program("subworld"), "device", "list"}, environment);
  EXPECT_NE(listed.out.find("dhd: version 1"), std::string::npos) << listed.out;
  const Ended checked = finish({program("subworld"), "device", "check", "dhd", "--duration", "1"}, environment);
  EXPECT_NE(checked.out.find("velocities agree with the positions"), std::string::npos) << checked.out;
  EXPECT_NE(checked.out.find("no call throws: none did: ok"), std::string::npos) << checked.out;

  Process process(words_of("dhd", "", "4"), folder_.path(), environment);
  ASSERT_TRUE(runs());
  std::ofstream(folder_.path() + "/unplugged") << "now";
  EXPECT_TRUE(eventually(
      [&] {
        return read_text(out() + "/logs/device_sim_0.log")
                   .find(
                       "device dhd is lost: dhdGetPosition: no device "
                       "found") != std::string::npos;
      },
      3.0));
  std::filesystem::remove(folder_.path() + "/unplugged");
  const Ended ended{process.wait().value_or(-1), process.out(), process.err()};
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("device dhd of user 0 was absent 1 time"), std::string::npos) << ended.out;
  const double largest_n = std::stod("0" + read_text(folder_.path() + "/force"));
  EXPECT_GT(largest_n, 1.0) << "the cube was pressed";
  EXPECT_LE(largest_n, 12.0 * (1.0 + 1e-9)) << "the limit of the device, not that of the scene, holds";
}

// 19 faults of the service in one run; the stand-in is the device, and checks the force.
TEST_F(Devices, AnInverse3SurvivesTheFaultsOfItsService) {
  Words words{"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/haply_service.py", "all"};
  const Words run = run_words(scene("press"), {"--mode", "realtime", "--duration", "1000"});
  words.insert(words.end(), run.begin(), run.end());
  const Ended ended = finish(words);
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["device"][0]["driver"]["name"], "haply");
}

TEST_F(Devices, AnInverse3ThatIsNotThereIsNamed) {
  const Ended checked = finish({program("subworld"), "device", "check", "haply", "--device-settings", "port=1"});
  EXPECT_EQ(checked.code, 4) << checked.out;
  EXPECT_NE(checked.out.find("the Haply Inverse Service at ws://127.0.0.1:1: "), std::string::npos) << checked.out;
  EXPECT_NE(checked.out.find("start it, or name another address or port"), std::string::npos) << checked.out;
}

TEST_F(Devices, TheCheckOfADriverThatCrashesEndsWith4) {
  const Ended ended =
      finish({program("subworld"), "device", "check", "faulty", "--device-settings", "crashes", "--duration", "1"},
             {{"SUBWORLD_DEVICES", TEST_DEVICES_FOLDER}});
  EXPECT_EQ(ended.code, 4) << ended.out;
  EXPECT_NE(ended.out.find("verdict: the driver crashes: Aborted"), std::string::npos) << ended.out;
}

TEST_F(Devices, TheCheckOfAFaultyDriverEndsWith4) {
  const Ended ended = finish(
      {program("subworld"), "device", "check", "faulty", "--device-settings", "millimetres", "--duration", "0.5"},
      {{"SUBWORLD_DEVICES", TEST_DEVICES_FOLDER}});
  EXPECT_EQ(ended.code, 4) << ended.out;
  EXPECT_NE(ended.out.find("positions are within the workspace, in metres"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("MISSED"), std::string::npos) << ended.out;
}

}  // namespace
}  // namespace subworld::test
