#include "process/process_test.hpp"

#include <map>
#include <sstream>

namespace subworld::test {
namespace {

std::string udp_settings(int port) { return "port=" + std::to_string(port) + " velocity=0"; }

class ForeignDevice : public ProcessTest, public ::testing::WithParamInterface<std::string> {};

// A C program of another maker: its types come from the IDL by Cyclone's own compiler.
TEST_P(ForeignDevice, PlaysAUsersDeviceInARunningSystem) {
  const auto folder = [&](const std::string& name) {
    std::filesystem::create_directory(folder_.path() + "/" + name);
    return folder_.path() + "/" + name;
  };
  const Words flags{"--mode",       "realtime", "--duration", "3",     "--domain",
                    domain_.text(), "--dds",    GetParam(),   "--out", out()};
  const auto words = [&](const std::string& name, const Words& more = {}) {
    Words all{program(name), scene("press")};
    all.insert(all.end(), flags.begin(), flags.end());
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  Process world(words("world_sim"), folder("world"));
  Process haptic(words("haptic_sim", {"--user", "0"}), folder("haptic"));
  Process device({program("foreign_device"), domain_.text(), "0"}, folder("device"),
                 {{"CYCLONEDDS_URI", std::string("file://") + SOURCE_FOLDER + "/tests/interop/foreign_device.xml"}});
  EXPECT_EQ(world.wait(), 0) << world.err();
  EXPECT_EQ(haptic.wait(), 0) << haptic.err();
  EXPECT_EQ(device.wait(), 0) << device.err();
  const Json felt = Json::parse(device.out(), nullptr, false);
  ASSERT_TRUE(felt.is_object()) << device.out();
  EXPECT_GT(felt["commands"], 200);
  EXPECT_GT(felt["largest_n"], 5.0) << "it presses the cube against the wall";
  EXPECT_EQ(felt["at_end_n"], 0.0) << "the last forces fade";
  EXPECT_EQ(felt["last"], 1);
  const Json summed = Json::parse(read_text(out() + "/haptic_0.json"), nullptr, false);
  EXPECT_GT(summed["force_max_n"], 5.0);
  EXPECT_EQ(summed["ending"]["fault"], "");
}

// Another C program: its types come from the public definitions of ROS 2.
TEST_P(ForeignDevice, OfRos2FeelsTheRunAndDrivesAUser) {
  const TestDomain ros;
  const int port = 47900 + domain_.number();
  // A pendulum of 0.1 m, far from the cube, that begins at 0.2 rad.
  const std::string press = edited(
      "press", "users:",
      "  - {name: bob, shape: sphere, radius_m: 0.02, mass_kg: 0.5, material: plain, position_m: [0, "
      "1.01987, 0.20199]}\njoints:\n  - {name: pivot, type: hinge, bodies: [bob, wall], at_m: [0, 1, 0.3], axis: "
      "[1, 0, 0]}\nusers:");
  const std::string peers = folder_.path() + "/peer";
  std::filesystem::create_directory(peers);
  Process process(run_words(press, {"--mode", "realtime", "--duration", "1000", "--dds", GetParam(), "--device", "udp",
                                    "--device-settings", udp_settings(port), "--ros2", ros.text()}),
                  folder_.path());
  Process peer({program("ros2_peer"), ros.text()}, peers,
               {{"CYCLONEDDS_URI", std::string("file://") + SOURCE_FOLDER + "/tests/interop/foreign_device.xml"}});
  EXPECT_EQ(peer.wait(), 0) << peer.err();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(), 0) << process.err();
  std::istringstream words(peer.out());
  std::map<std::string, std::string> heard;
  for (std::string name, value; words >> name >> value;) heard[name] = value;
  EXPECT_LT(std::stod(heard["least_n"].empty() ? "0" : heard["least_n"]), -15.0)
      << "the wall pushes back along -x: " << peer.out();
  EXPECT_EQ(heard["x_m"], "0.050") << peer.out();
  EXPECT_GT(std::stol("0" + heard["clocks"]), 10) << peer.out();
  EXPECT_GT(std::stol("0" + heard["transforms"]), 10) << peer.out();
  EXPECT_EQ(heard["shown"], "4") << "cube, wall, bob and proxy; the floor has no end: " << peer.out();
  EXPECT_EQ(heard["frame"], "world") << peer.out();
  ASSERT_EQ(heard["joint"], "pivot") << peer.out();
  const double amplitude = 0.5 * (std::stod(heard["turn_most"]) - std::stod(heard["turn_least"]));
  EXPECT_NEAR(amplitude, 0.2, 0.01) << peer.out();
  // sqrt(m g l / (m l^2 + 2/5 m r^2)) = 9.83 rad/s; 30 samples a second miss the largest rate by up to 1.3 %.
  EXPECT_NEAR(std::stod(heard["turn_rate"]) / amplitude, 9.8, 0.3) << peer.out();
}

// The world waits for the program that shows it to ROS 2, which ends with it.
class Ros2 : public ProcessTest {};

TEST_F(Ros2, IsShownARunAndChangesNothing) {
  const TestDomain ros;
  ASSERT_EQ(run(scene("press"), {"--mode", "lockstep", "--duration", "0.1"}).code, 0);
  const std::string hash = summary()["state_hash"];
  const Ended ended =
      run(scene("press"), {"--mode", "lockstep", "--duration", "0.1", "--dds", "mixed", "--ros2", ros.text()});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_EQ(summary()["state_hash"], hash);
  EXPECT_NE(ended.out.find("ROS 2: domain " + ros.text()), std::string::npos) << ended.out;
  const Ended refused = run(scene("press"), {"--mode", "lockstep", "--ros2", domain_.text()});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("is the domain of the run"), std::string::npos) << refused.err;
}

INSTANTIATE_TEST_SUITE_P(Vendors, ForeignDevice, ::testing::Values("fastdds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, ForeignDevice, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
