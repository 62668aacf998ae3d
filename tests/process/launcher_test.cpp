// What remains where the launcher is killed.
#include "process/faults/ends.hpp"

namespace subworld::test {
namespace {

class LauncherIsKilled : public RunEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(LauncherIsKilled, WithAHaltedProgramAndNothingIsLeftBehind) {
  start(GetParam(), "mixed", "1000");
  if (HasFatalFailure()) return;
  signal("haptic_sim", SIGSTOP);
  process_->signal(SIGKILL);
  ASSERT_EQ(process_->wait(), 128 + SIGKILL);
  EXPECT_TRUE(eventually([&] { return running(out()).empty(); }));
  const Json json = summary();
  ASSERT_TRUE(json.is_object()) << process_->err();
  // The keeper continues halted programs.
  EXPECT_TRUE(json["verdict"].get<std::string>().starts_with("failed: the launcher was killed at t = "))
      << json["verdict"];
  for (const Json& part : {json["world"], json["haptic"][0], json["device"][0]})
    EXPECT_TRUE(part.contains("ending")) << part;
  for (const auto& entry : std::filesystem::directory_iterator(out()))
    EXPECT_TRUE(entry.path().extension() != ".part" && entry.path().filename() != "haptic_0.json") << entry.path();
  // Neither the domain nor the folder is locked.
  EXPECT_EQ(run(scene("press"), {"--duration", "0.1"}).code, 0);
}

TEST_P(LauncherIsKilled, WithItsKeeperAndCollectMakesTheSummary) {
  start(GetParam(), "mixed", "1000");
  if (HasFatalFailure()) return;
  if (GetParam() == "lockstep") signal("haptic_sim", SIGKILL);
  signal("subworld", SIGKILL);
  ASSERT_TRUE(process_->wait());
  ASSERT_TRUE(eventually([&] { return running(out()).empty(); }));
  EXPECT_FALSE(std::filesystem::exists(out() + "/summary.json"));
  const std::string merged = folder_.path() + "/merged";
  const Ended ended = finish({program("subworld"), "collect", out(), "--out", merged, "--scene", scene("press")});
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.out.find("the launcher was killed"), std::string::npos) << ended.out << ended.err;
  const Json json = Json::parse(read_text(merged + "/summary.json"), nullptr, false);
  ASSERT_TRUE(json.is_object());
  EXPECT_GT(json["world"]["cycles"], 0);
  EXPECT_GT(json["haptic"][0]["steps"], 0);
  EXPECT_GT(json["device"][0]["steps"], 0);
}

INSTANTIATE_TEST_SUITE_P(Modes, LauncherIsKilled, ::testing::Values("lockstep"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, LauncherIsKilled, ::testing::Values("realtime"),
                         [](const auto& one) { return one.param; });

// The keeper knows who was started again, and makes the trace.
TEST_F(RunEnds, AKilledLauncherLosesNeitherTheRestartsNorTheTrace) {
  start("realtime", "fastdds", "1000", {"--restart", "on-failure", "--trace", folder_.path() + "/trace.json"});
  if (HasFatalFailure()) return;
  signal("device_sim", SIGKILL);
  ASSERT_TRUE(eventually([&] { return process_->err().find("it is started again") != std::string::npos; }));
  const auto loops_again = [&] {
    const std::string log = read_text(out() + "/logs/device_sim_0.log"), begun = "1000 Hz";
    return log.find(begun, log.find(begun) + 1) != std::string::npos;
  };
  ASSERT_TRUE(eventually(loops_again));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  process_->signal(SIGKILL);
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(out() + "/summary.json"); })) << process_->err();
  ASSERT_TRUE(eventually([&] { return running(out()).empty(); }));
  const Json json = summary();
  EXPECT_TRUE(json["verdict"].get<std::string>().starts_with("failed: the launcher was killed at t = "))
      << json["verdict"];
  ASSERT_EQ(json["restarts"].size(), 1U);
  EXPECT_EQ(json["restarts"][0]["program"], "device_sim_0");
  EXPECT_EQ(json["restarts"][0]["reason"], "killed by SIGKILL");
  EXPECT_GT(json["restarts"][0]["after_s"], 0.0);
  EXPECT_GT(json["wall_s"], 0.0);
  EXPECT_FALSE(std::filesystem::exists(out() + "/trace"));
  EXPECT_NE(read_text(folder_.path() + "/trace.json").find("haptic_sim 0"), std::string::npos);
}

}  // namespace
}  // namespace subworld::test
