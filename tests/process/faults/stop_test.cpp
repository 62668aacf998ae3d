#include "process/process_test.hpp"

#include <optional>

namespace subworld::test {
namespace {

class Stop : public ProcessTest {
 protected:
  /// A run with a duration of a quarter of an hour, in the middle of its loops.
  void start(const std::string& mode, Process::Output output = Process::Output::files) {
    process_.emplace(run_words(scene("press"), {"--mode", mode, "--duration", "1000", "--dds", "mixed"}),
                     folder_.path(), Environment{}, output);
    const bool loops = eventually([&] {
      if (output == Process::Output::terminal) process_->read_terminal();
      return mode == "realtime" ? read_text(out() + "/logs/haptic_sim_0.log").find(" Hz") != std::string::npos
                                : read_text(out() + "/haptic_0.csv").size() > 10000;
    });
    ASSERT_TRUE(loops) << process_->err();
    if (mode == "realtime") std::this_thread::sleep_for(std::chrono::milliseconds(300));
  }
  /// All programs must end. Returns the launcher's exit code, which is an error where it had to kill one.
  int expect_end() {
    const auto code = process_->wait();
    EXPECT_TRUE(code) << "the launcher still runs";
    EXPECT_TRUE(eventually([&] { return running(out()).empty(); }));
    return code.value_or(-1);
  }
  void expect_stopped_by(const std::string& name) const {
    const Json json = summary();
    ASSERT_FALSE(json.is_discarded());
    EXPECT_TRUE(json["verdict"].get<std::string>().starts_with("stopped by " + name + " at t = ")) << json["verdict"];
    EXPECT_FALSE(json["gates"].empty());
    EXPECT_GT(json["simulated_s"], 0.0);  // results so far
    EXPECT_GT(json["haptic"][0]["steps"], 0);
    EXPECT_GT(json["device"][0]["steps"], 0);
  }
  [[nodiscard]] pid_t find(const std::string& name) const {
    for (const Running& one : running(out())) {
      if (one.words.front().ends_with("/" + name)) return one.pid;
    }
    return -1;
  }

  std::optional<Process> process_;
};

TEST_F(Stop, AFaultNamesItsAddressAndTheCallsThatLedToIt) {
  start("lockstep");
  if (HasFatalFailure()) return;
  kill(find("haptic_sim"), SIGBUS);
  EXPECT_EQ(expect_end(), 1);
  EXPECT_NE(process_->err().find("haptic_sim_0 killed by SIGBUS"), std::string::npos) << process_->err();
  const std::string log = read_text(out() + "/logs/haptic_sim_0.log");
  EXPECT_NE(log.find("error: signal 7 (code 0) at address"), std::string::npos) << log;
  EXPECT_NE(log.find("haptic_sim("), std::string::npos) << log;
}

class StopMode : public Stop, public ::testing::WithParamInterface<std::string> {};

TEST_P(StopMode, AClosedTerminalEndsEverythingInOrder) {
  start(GetParam(), Process::Output::terminal);
  if (HasFatalFailure()) return;
  EXPECT_TRUE(eventually([&] { return process_->read_terminal().find(" of 1000 s") != std::string::npos; }))
      << "shows no progress: " << process_->read_terminal();
  process_->close_terminal();
  EXPECT_EQ(expect_end(), 0);
  expect_stopped_by("SIGHUP");
}

INSTANTIATE_TEST_SUITE_P(Runs, StopMode, ::testing::Values("lockstep"), [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, StopMode, ::testing::Values("realtime"),
                         [](const auto& one) { return one.param; });

TEST_F(Stop, UnderNohupAHangupEndsNothing) {
  Words words = run_words(scene("press"), {"--mode", "lockstep", "--duration", "1000"});
  words.insert(words.begin(), "/usr/bin/nohup");
  process_.emplace(words, folder_.path());
  const auto steps = [&] { return read_text(out() + "/haptic_0.csv").size(); };
  ASSERT_TRUE(eventually([&] { return steps() > 10000; })) << process_->err();
  for (const char* name : {"subworld", "world_sim", "haptic_sim", "device_sim"}) kill(find(name), SIGHUP);
  const std::size_t before = steps();
  EXPECT_TRUE(eventually([&] { return steps() > before + 10000; })) << process_->err();
  process_->signal(SIGTERM);
  EXPECT_EQ(expect_end(), 0);
  expect_stopped_by("SIGTERM");
}

TEST_F(Stop, WhileTheWorldSettles) {
  std::string text = read_text(scene("heap"));
  const std::string settle = "settle: {duration_s: 3,";
  ASSERT_NE(text.find(settle), std::string::npos);
  text.replace(text.find(settle), settle.size(), "settle: {duration_s: 1000,");
  process_.emplace(run_words(folder_.write("heap.yaml", text), {}), folder_.path());
  // The world prints its settings just before it settles.
  ASSERT_TRUE(eventually([&] { return !read_text(out() + "/logs/world_sim.log").empty() && find("device_sim") > 0; }));
  process_->signal(SIGTERM);
  EXPECT_EQ(expect_end(), 0) << process_->err();
  EXPECT_EQ(summary()["verdict"], "stopped by SIGTERM");
}

}  // namespace
}  // namespace subworld::test
