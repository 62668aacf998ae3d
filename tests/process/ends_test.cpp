// The ends of programs and runs: message, exit code, and at most two seconds of time.
#include "process/process_test.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <tuple>

namespace subworld::test {
namespace {

constexpr double kEndBound_s = 3.0;  // two seconds and tolerance for a busy machine

using Instant = std::chrono::steady_clock::time_point;

Instant now() { return std::chrono::steady_clock::now(); }
double seconds_after(Instant begin) { return std::chrono::duration<double>(now() - begin).count(); }

/// One program with its own folder for output.
struct Started {
  std::string name;
  std::unique_ptr<Process> process;
};

/// The programs of a run of scene `press`, each started by hand.
class ByHandEnds : public ProcessTest {
 protected:
  void TearDown() override {
    started_.clear();
    ProcessTest::TearDown();
  }

  Process& start(const std::string& name, const Words& flags = {}, const Environment& environment = {}) {
    const std::string folder = folder_.path() + "/" + std::to_string(started_.size()) + "_" + name;
    std::filesystem::create_directories(folder);
    Words words{program(name), scene("press"), "--domain", domain_.text()};
    words.insert(words.end(), common_.begin(), common_.end());
    words.insert(words.end(), flags.begin(), flags.end());
    started_.push_back({name, std::make_unique<Process>(words, folder, environment)});
    return *started_.back().process;
  }
  /// World, haptic process and device, in the middle of their loops.
  void start_run(const std::string& mode, const std::string& dds, const Words& flags = {}) {
    common_ = {"--mode", mode, "--dds", dds, "--duration", "1000"};
    common_.insert(common_.end(), flags.begin(), flags.end());
    world_ = &start("world_sim");
    haptic_ = &start("haptic_sim", {"--out", out()});
    device_ = &start("device_sim");
    ASSERT_TRUE(eventually([&] {
      return mode == "realtime" ? haptic_->out().find(" Hz") != std::string::npos
                                : read_text(out() + "/haptic_0.csv").size() > 10000;
    })) << haptic_->err();
    if (mode == "realtime") std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }

  Words common_;
  std::vector<Started> started_;
  Process* world_ = nullptr;
  Process* haptic_ = nullptr;
  Process* device_ = nullptr;
};

class Waiting : public ByHandEnds, public ::testing::WithParamInterface<std::tuple<std::string, int>> {};

TEST_P(Waiting, ASignalEndsEveryProgram) {
  const auto& [dds, signal] = GetParam();
  common_ = {"--dds", dds};
  for (const char* name : {"haptic_sim", "device_sim", "gui_headless"}) start(name);
  const TestDomain other;
  start("world_sim", {"--domain", other.text(), "--await-display"});
  for (const Started& one : started_) {
    ASSERT_TRUE(eventually([&] { return one.process->out().find("dds=") != std::string::npos; })) << one.name;
  }
  const Instant begin = now();
  for (const Started& one : started_) one.process->signal(signal);
  for (const Started& one : started_) EXPECT_EQ(one.process->wait(10.0), 0) << one.name << one.process->err();
  EXPECT_LT(seconds_after(begin), kEndBound_s);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Waiting,
                         ::testing::Combine(::testing::Values("fastdds", "cyclonedds"),
                                            ::testing::Values(SIGINT, SIGTERM)),
                         [](const auto& one) {
                           return std::get<0>(one.param) + (std::get<1>(one.param) == SIGINT ? "_INT" : "_TERM");
                         });

TEST_F(ByHandEnds, ASignalEndsAProgramThatLoads) {
  Process& world = start("world_sim", {"--engine", "slow"}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const Instant begin = now();
  world.signal(SIGTERM);
  EXPECT_EQ(world.wait(10.0), 0) << world.err();
  EXPECT_LT(seconds_after(begin), kEndBound_s);
  EXPECT_EQ(world.out().find("settling"), std::string::npos) << "it had loaded already";
}

// A busy program may take any time, for example to make an engine.
TEST_F(ByHandEnds, ASignalEndsAProgramThatIsBusy) {
  common_ = {"--mode", "realtime", "--duration", "1000"};
  Process& world = start("world_sim", {}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  start("haptic_sim");
  start("device_sim");
  ASSERT_TRUE(eventually([&] { return world.out().find("running") != std::string::npos; })) << world.err();
  const Ended order =
      finish({program("subworld"), "control", "engine", "slow", "--domain", domain_.text(), "--wait", "2"});
  ASSERT_NE(order.err.find("preparing"), std::string::npos) << order.err;
  const Instant begin = now();
  world.signal(SIGTERM);
  EXPECT_TRUE(world.wait(10.0));
  EXPECT_LT(seconds_after(begin), kEndBound_s);
}

class Halted : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

// Its reports do not arrive, but its death is not yet certain.
TEST_P(Halted, ASignalEndsALockstepWorldThatWaitsForAHapticProcess) {
  start_run("lockstep", GetParam());
  if (HasFatalFailure()) return;
  haptic_->signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const Instant begin = now();
  world_->signal(SIGTERM);
  EXPECT_EQ(world_->wait(10.0), 0) << world_->err();
  EXPECT_LT(seconds_after(begin), kEndBound_s);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Halted, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

/// The killed program and, if `restarted`, its immediate restart.
struct Loss {
  std::string mode;
  std::string dds;
  std::string victim;
};
void PrintTo(const Loss& one, std::ostream* out) { *out << one.mode << " " << one.dds << " " << one.victim; }
std::string name_of(const ::testing::TestParamInfo<Loss>& one) {
  return one.param.mode + "_" + one.param.dds + "_" + one.param.victim;
}
std::vector<Loss> losses(const Words& vendors) {
  std::vector<Loss> all;
  for (const char* mode : {"lockstep", "realtime"}) {
    for (const std::string& dds : vendors) {
      for (const char* victim : {"world_sim", "haptic_sim", "device_sim"}) all.push_back({mode, dds, victim});
    }
  }
  return all;
}

class RestartedByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {};

// A run consists of the programs with which it began: each peer of a restarted program reports the restart, and so does
// the restarted program.
TEST_P(RestartedByHand, IsAnErrorOfEachPeerThatNamesIt) {
  const Loss& loss = GetParam();
  start_run(loss.mode, loss.dds, {"--wait", "3"});
  if (HasFatalFailure()) return;
  Process* const victim = loss.victim == "world_sim" ? world_ : loss.victim == "haptic_sim" ? haptic_ : device_;
  victim->signal(SIGKILL);
  ASSERT_EQ(victim->wait(), 128 + SIGKILL);
  Process& again = start(loss.victim);
  std::string said;
  for (const Started& one : started_) {
    if (one.process.get() == victim) continue;
    const auto code = one.process->wait(15.0);
    // A device that its haptic process has notified of the end ends in order.
    EXPECT_TRUE(code == 1 || (code == 0 && one.process.get() == device_)) << one.name << ": " << one.process->err();
    if (one.process.get() != &again) said += one.process->err();
  }
  const std::string label = loss.victim == "world_sim" ? loss.victim : loss.victim + " 0";
  const bool restarted = said.find("error: " + label + " was started again") != std::string::npos;
  const bool died = said.find("error: " + label + " has died") != std::string::npos;
  EXPECT_TRUE(restarted || died) << said;
}

INSTANTIATE_TEST_SUITE_P(Programs, RestartedByHand, ::testing::ValuesIn(losses({"fastdds", "cyclonedds"})), name_of);

class LostByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(LostByHand, IsNamedByItsPeers) {
  const Loss& loss = GetParam();
  start_run(loss.mode, loss.dds);
  if (HasFatalFailure()) return;
  Process* const victim = loss.victim == "world_sim" ? world_ : loss.victim == "haptic_sim" ? haptic_ : device_;
  victim->signal(SIGKILL);
  std::string said;
  for (Process* one : {world_, haptic_, device_}) {
    if (one == victim) continue;
    const auto code = one->wait(15.0);
    said += one->err();
    // A program that a neighbour notifies of the end of the run ends in order.
    EXPECT_TRUE(code == 1 || (code == 0 && one == device_)) << one->err();
  }
  const std::string label = loss.victim == "world_sim" ? loss.victim : loss.victim + " 0";
  EXPECT_NE(said.find("error: " + label + " has died"), std::string::npos) << said;
}

INSTANTIATE_TEST_SUITE_P(Programs, LostByHand, ::testing::ValuesIn(losses({"fastdds", "cyclonedds"})), name_of);

class OtherScene : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(OtherScene, OfADeviceIsRefusedAndTheOthersLearnWhy) {
  common_ = {"--mode", GetParam(), "--duration", "1000"};
  Process& world = start("world_sim");
  Process& haptic = start("haptic_sim");
  Process& device = start("device_sim", {"--ratio", "10"});
  EXPECT_EQ(device.wait(10.0), 2) << device.err();
  const std::string why = "with other settings: settings.ratio is 10, in the world 4. Give all programs";
  EXPECT_NE(device.err().find(why), std::string::npos) << device.err();
  for (Process* const other : {&world, &haptic}) {
    const auto knows = [&] {
      const std::string said = other->err();
      const std::size_t at = said.find("device_sim 0 has ended: ");
      return at != std::string::npos && said.find(why, at) != std::string::npos;
    };
    EXPECT_TRUE(eventually(knows)) << other->err();
  }
  for (const Started& one : started_) one.process->signal(SIGTERM);
  for (const Started& one : started_) EXPECT_TRUE(one.process->wait(10.0)) << one.name;
}

INSTANTIATE_TEST_SUITE_P(Modes, OtherScene, ::testing::Values("lockstep", "realtime"),
                         [](const auto& one) { return one.param; });

/// A run of the launcher, and an event in one of its programs.
class RunEnds : public ProcessTest {
 protected:
  void start(const std::string& mode, const std::string& dds, const std::string& duration, const Words& flags = {}) {
    Words all{"--mode", mode, "--dds", dds, "--duration", duration};
    all.insert(all.end(), flags.begin(), flags.end());
    process_.emplace(run_words(scene("press"), all), folder_.path());
    ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_0.csv").size() > 10000; })) << process_->err();
  }
  void signal(const std::string& name, int number) const {
    for (const Running& one : running(out())) {
      if (one.words.front().ends_with("/" + name)) kill(one.pid, number);
    }
  }
  void expect_failed(const std::string& words, Instant begin) {
    EXPECT_EQ(process_->wait(10.0), 1) << process_->err();
    EXPECT_LT(seconds_after(begin), kEndBound_s);
    const std::string verdict = summary()["verdict"];
    EXPECT_TRUE(verdict.starts_with("failed: " + words)) << verdict;
    EXPECT_NE(process_->out().find("verdict: failed: " + words), std::string::npos) << process_->out();
  }

  std::optional<Process> process_;
};

class RunLoses : public RunEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(RunLoses, AProgramThatIsStoppedFromOutside) {
  const Loss& loss = GetParam();
  start(loss.mode, loss.dds, "1000");
  if (HasFatalFailure()) return;
  const Instant begin = now();
  signal(loss.victim, SIGTERM);
  const std::string label = loss.victim == "world_sim" ? loss.victim : loss.victim + "_0";
  expect_failed(label + " was stopped by SIGTERM at t = ", begin);
}

INSTANTIATE_TEST_SUITE_P(Programs, RunLoses, ::testing::ValuesIn(losses({"mixed"})), name_of);

class RunHalts : public RunEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(RunHalts, AProgram) {
  const Loss& loss = GetParam();
  start(loss.mode, loss.dds, "1000");
  if (HasFatalFailure()) return;
  const Instant begin = now();
  signal(loss.victim, SIGSTOP);
  const std::string label = loss.victim == "world_sim" ? loss.victim : loss.victim + "_0";
  expect_failed(label + " is halted", begin);
}

INSTANTIATE_TEST_SUITE_P(Programs, RunHalts, ::testing::ValuesIn(losses({"mixed"})), name_of);

class RunWithDisplay : public RunEnds, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

TEST_P(RunWithDisplay, GoesOnWithoutIt) {
  const auto& [mode, dds] = GetParam();
  start(mode, dds, mode == "realtime" ? "3" : "20", {"--gui"});
  if (HasFatalFailure()) return;
  signal("gui_headless", SIGKILL);
  EXPECT_EQ(process_->wait(), 0) << process_->err();
  EXPECT_NE(process_->out().find("the display failed (gui_headless killed by SIGKILL): no picture"), std::string::npos)
      << process_->out();
  EXPECT_NEAR(summary()["simulated_s"].get<double>(), mode == "realtime" ? 3.0 : 20.0, 0.01);
}

INSTANTIATE_TEST_SUITE_P(Modes, RunWithDisplay,
                         ::testing::Combine(::testing::Values("lockstep", "realtime"),
                                            ::testing::Values("fastdds", "cyclonedds")),
                         [](const auto& one) { return std::get<0>(one.param) + "_" + std::get<1>(one.param); });

TEST_F(RunEnds, AHistoryHoldsWhatAKilledProgramHasDone) {
  start("realtime", "fastdds", "1000");
  if (HasFatalFailure()) return;
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  const std::size_t at_least = 500;  // of the 1500 and more steps that were made
  signal("haptic_sim", SIGKILL);
  EXPECT_EQ(process_->wait(10.0), 1);
  EXPECT_GT(read_table(out() + "/haptic_0.csv").rows.size(), at_least);
  EXPECT_GT(read_table(out() + "/device_0.csv").rows.size(), at_least);
}

class RunOnAFullDisk : public RunEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(RunOnAFullDisk, SaysSoAtOnceAndGoesOnButIsNotOk) {
  std::filesystem::create_directories(out());
  std::filesystem::create_symlink("/dev/full", out() + "/haptic_0.csv");
  const std::string duration = GetParam() == "realtime" ? "2" : "20";
  process_.emplace(run_words(scene("press"), {"--mode", GetParam(), "--duration", duration}), folder_.path());
  ASSERT_TRUE(eventually([&] {
    return read_text(out() + "/logs/haptic_sim_0.log").find("haptic_0.csv: No space left on device") !=
           std::string::npos;
  }));
  EXPECT_FALSE(std::filesystem::exists(out() + "/haptic_0.json")) << "only at the end";
  EXPECT_EQ(process_->wait(), 1);
  const Json json = summary();
  EXPECT_NE(json["verdict"].get<std::string>().find("haptic_0.csv: No space left on device"), std::string::npos)
      << json["verdict"];
  EXPECT_NEAR(json["simulated_s"].get<double>(), std::stod(duration), 0.01) << "the run did not go on";
}

INSTANTIATE_TEST_SUITE_P(Modes, RunOnAFullDisk, ::testing::Values("lockstep", "realtime"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
