// The ends of programs and runs: message, exit code, and at most two seconds of time.
#include "process/process_test.hpp"

#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
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

class RestartedByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {
 protected:
  /// Kills a program and starts it again.
  void restart() {
    start_run(GetParam().mode, GetParam().dds, {"--wait", "5"});
    if (HasFatalFailure()) return;
    const std::string& name = GetParam().victim;
    victim_ = name == "world_sim" ? world_ : name == "haptic_sim" ? haptic_ : device_;
    victim_->signal(SIGKILL);
    ASSERT_EQ(victim_->wait(), 128 + SIGKILL);
    again_ = &start(name, name == "haptic_sim" ? Words{"--out", out()} : Words{});
  }

  Process* victim_ = nullptr;
  Process* again_ = nullptr;
};
class RestartedInLockstep : public RestartedByHand {};

// A run in lock-step consists of the programs with which it began: each peer of a restarted program reports the
// restart, and so does the restarted program.
TEST_P(RestartedInLockstep, IsAnErrorOfEachPeerThatNamesIt) {
  restart();
  if (HasFatalFailure()) return;
  std::string said;
  for (const Started& one : started_) {
    if (one.process.get() == victim_) continue;
    const auto code = one.process->wait(15.0);
    EXPECT_EQ(code, 1) << one.name << ": " << one.process->err();
    if (one.process.get() != again_) said += one.process->err();
  }
  const std::string& name = GetParam().victim;
  const std::string label = name == "world_sim" ? name : name + " 0";
  const bool restarted = said.find("error: " + label + " was started again") != std::string::npos;
  const bool died = said.find("error: " + label + " has died") != std::string::npos;
  EXPECT_TRUE(restarted || died) << said;
}

class RestartedInRealTime : public RestartedByHand {};

// The others wait for it, and the run goes on.
TEST_P(RestartedInRealTime, TakesPartAgain) {
  restart();
  if (HasFatalFailure()) return;
  const std::string history = out() + "/haptic_0.csv";
  // New states of the device in new steps of the sub-world, which stands without a world.
  const auto goes_on_after = [&](std::size_t row) {
    const Table table = read_table(history);
    if (table.rows.size() < row + 400) return false;
    const auto past = [&](const char* column) {
      return std::abs(table.rows.back()[table.column(column)] -
                      table.rows[table.rows.size() - 50][table.column(column)]);
    };
    return past("device_time_s") > 0.0 && past("time_s") > 0.0;
  };
  EXPECT_TRUE(eventually([&] { return again_->out().find(" Hz") != std::string::npos; })) << again_->err();
  const std::size_t before = read_table(history).rows.size();
  EXPECT_TRUE(eventually([&] { return goes_on_after(before); })) << world_->err() << haptic_->err();
  if (GetParam().victim == "haptic_sim") {
    EXPECT_NE(world_->err().find("user 0 is absent from t = "), std::string::npos) << world_->err();
    EXPECT_NE(world_->err().find("user 0 takes part from t = "), std::string::npos) << world_->err();
  }
  (GetParam().victim == "world_sim" ? again_ : world_)->signal(SIGTERM);
  for (const Started& one : started_) {
    if (one.process.get() == victim_) continue;
    EXPECT_EQ(one.process->wait(10.0), 0) << one.name << ": " << one.process->err();
  }
}

std::vector<Loss> losses_in(const std::string& mode) {
  std::vector<Loss> all = losses({"fastdds", "cyclonedds"});
  std::erase_if(all, [&](const Loss& one) { return one.mode != mode; });
  return all;
}
INSTANTIATE_TEST_SUITE_P(Programs, RestartedInLockstep, ::testing::ValuesIn(losses_in("lockstep")), name_of);
INSTANTIATE_TEST_SUITE_P(Programs, RestartedInRealTime, ::testing::ValuesIn(losses_in("realtime")), name_of);

class LostByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(LostByHand, IsNamedByItsPeers) {
  const Loss& loss = GetParam();
  start_run(loss.mode, loss.dds, {"--wait", "2"});
  if (HasFatalFailure()) return;
  Process* const victim = loss.victim == "world_sim" ? world_ : loss.victim == "haptic_sim" ? haptic_ : device_;
  victim->signal(SIGKILL);
  std::string said;
  for (Process* one : {world_, haptic_, device_}) {
    if (one == victim) continue;
    const auto code = one->wait(15.0);
    said += one->err();
    EXPECT_EQ(code, 1) << one->err();
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
    // Each program writes its history ten times a second.
    ASSERT_TRUE(eventually([&] {
      return read_text(out() + "/haptic_0.csv").size() > 10000 && read_text(out() + "/device_0.csv").size() > 1000 &&
             read_text(out() + "/world.csv").size() > 1000;
    })) << process_->err();
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

class RunRestarts : public RunEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(RunRestarts, AProgramThatWasKilledAndServesEveryUserToTheEnd) {
  const Loss& loss = GetParam();
  start(loss.mode, loss.dds, "4", {"--restart", "on-failure"});
  if (HasFatalFailure()) return;
  signal(loss.victim, SIGKILL);
  EXPECT_EQ(process_->wait(60.0), 0) << process_->err();
  const Json json = summary();
  const bool world = loss.victim == "world_sim";
  ASSERT_EQ(json["restarts"].size(), 1U) << json["verdict"];
  EXPECT_EQ(json["restarts"][0]["program"], world ? loss.victim : loss.victim + "_0");
  EXPECT_EQ(json["restarts"][0]["reason"], "killed by SIGKILL");
  EXPECT_NEAR(json["simulated_s"].get<double>(), 4.0, 0.01);
  EXPECT_FALSE(json.contains("partial"));
  if (loss.victim != "haptic_sim") return;
  ASSERT_EQ(json["world"]["absences"].size(), 1U);
  EXPECT_LT(json["world"]["absences"][0]["to_s"].get<double>(), 4.0) << "it did not return";
  const Table table = read_table(out() + "/haptic_0.csv");
  EXPECT_LT(table.rows.front()[0], 0.1) << "the rows before its death are lost";
}

INSTANTIATE_TEST_SUITE_P(Programs, RunRestarts, ::testing::ValuesIn([] {
                           std::vector<Loss> all = losses({"mixed"});
                           std::erase_if(all, [](const Loss& one) { return one.mode != "realtime"; });
                           return all;
                         }()),
                         name_of);

TEST_F(RunEnds, OneThatIsHaltedForASecondIsStartedAgainAndNothingElseDies) {
  start("realtime", "cyclonedds", "5", {"--restart", "on-failure"});
  if (HasFatalFailure()) return;
  signal("device_sim", SIGSTOP);
  EXPECT_EQ(process_->wait(60.0), 0) << process_->err();
  const Json json = summary();
  ASSERT_EQ(json["restarts"].size(), 1U) << json["verdict"];
  EXPECT_EQ(json["restarts"][0]["program"], "device_sim_0");
  EXPECT_NEAR(json["simulated_s"].get<double>(), 5.0, 0.01);
}

TEST_F(ProcessTest, InLockstepNothingIsStartedAgain) {
  const Ended ended = finish(run_words(scene("press"), {"--restart", "always"}));
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("--restart: a run in lock-step ends with the first of its programs; use --mode realtime"),
            std::string::npos)
      << ended.err;
}

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

class RunIsKilled : public RunEnds, public ::testing::WithParamInterface<Loss> {};

// What the survivors measured is in the summary, and what the killed program wrote to its history.
TEST_P(RunIsKilled, AndLosesNoMeasurements) {
  const Loss& loss = GetParam();
  start(loss.mode, loss.dds, "1000");
  if (HasFatalFailure()) return;
  const Instant begin = now();
  signal(loss.victim, SIGKILL);
  const bool world = loss.victim == "world_sim";
  expect_failed((world ? loss.victim : loss.victim + "_0") + " killed by SIGKILL", begin);
  const Json json = summary();
  EXPECT_EQ(json["partial"], true);
  EXPECT_GT(json["simulated_s"].get<double>(), 0.0);
  const std::map<std::string, Json> parts{
      {"world_sim", json["world"]}, {"haptic_sim", json["haptic"][0]}, {"device_sim", json["device"][0]}};
  for (const auto& [name, part] : parts) {
    EXPECT_GT(part[name == "world_sim" ? "cycles" : "steps"].get<double>(), 0.0) << name;
    EXPECT_EQ(part.contains("partial"), name == loss.victim) << name;
    EXPECT_EQ(part.contains("ending"), name != loss.victim) << name;
  }
  if (loss.victim == "haptic_sim") {
    const Table table = read_table(out() + "/haptic_0.csv");
    EXPECT_EQ(parts.at("haptic_sim")["steps"].get<std::size_t>(), table.rows.size());
    EXPECT_NEAR(parts.at("haptic_sim")["to_s"], table.rows.back()[table.column("time_s")], 1e-9);
    EXPECT_TRUE(parts.at("haptic_sim").contains("force_max_n"));
  }
  for (const auto& entry : std::filesystem::directory_iterator(out()))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
}

INSTANTIATE_TEST_SUITE_P(Programs, RunIsKilled, ::testing::ValuesIn(losses({"mixed"})), name_of);

class LauncherIsKilled : public RunEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(LauncherIsKilled, AndCollectMakesTheSummary) {
  start(GetParam(), "mixed", "1000");
  if (HasFatalFailure()) return;
  if (GetParam() == "lockstep") signal("haptic_sim", SIGKILL);
  process_->signal(SIGKILL);
  ASSERT_TRUE(process_->wait(10.0));
  ASSERT_TRUE(eventually([&] { return running(out()).empty(); }, 10.0));
  const std::string merged = folder_.path() + "/merged";
  const Ended ended = finish({program("subworld"), "collect", out(), "--out", merged, "--scene", scene("press")});
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.out.find("`subworld run` was killed"), std::string::npos) << ended.out << ended.err;
  const Json json = Json::parse(read_text(merged + "/summary.json"), nullptr, false);
  ASSERT_TRUE(json.is_object());
  EXPECT_GT(json["world"]["cycles"], 0);
  EXPECT_GT(json["haptic"][0]["steps"], 0);
  EXPECT_GT(json["device"][0]["steps"], 0);
}

INSTANTIATE_TEST_SUITE_P(Modes, LauncherIsKilled, ::testing::Values("lockstep", "realtime"),
                         [](const auto& one) { return one.param; });

TEST_F(ByHandEnds, AProgramThatIsRefusedLeavesTheHistoryOfTheKilledOne) {
  start_run("lockstep", "fastdds", {"--wait", "3"});
  if (HasFatalFailure()) return;
  haptic_->signal(SIGKILL);
  ASSERT_EQ(haptic_->wait(), 128 + SIGKILL);
  const std::size_t before = read_table(out() + "/haptic_0.csv").rows.size();
  Process& again = start("haptic_sim", {"--out", out()});
  EXPECT_EQ(again.wait(15.0), 1) << again.out();
  EXPECT_EQ(read_table(out() + "/haptic_0.csv").rows.size(), before);
  for (Process* one : {world_, device_}) EXPECT_TRUE(one->wait(15.0));
}

/// Runs a shell command with a file system of 2 MB at `out()`.
class SmallDisk : public RunEnds {
 protected:
  Ended on_small_disk(const std::string& before, const Words& words, const std::string& after) const {
    std::string command =
        "mount -t tmpfs -o size=2m tmpfs " + out() + " || exit 77; mkdir " + out() + "/results; " + before + "; ";
    for (const std::string& word : words) command += "'" + word + "' ";
    std::filesystem::create_directories(out());
    return finish({"/usr/bin/unshare", "-m", "--propagation", "private", "/bin/sh", "-c",
                   command + "; code=$?; " + after + "; exit $code"});
  }
  [[nodiscard]] Words words(const Words& flags) const {
    Words all{program("subworld"), "run", scene("press"), "--domain", domain_.text(), "--out", out() + "/results"};
    all.insert(all.end(), flags.begin(), flags.end());
    return all;
  }
};

TEST_F(SmallDisk, ThatFillsUpLosesNeitherTheVerdictNorTheSummary) {
  const Ended ended = on_small_disk(":", words({"--duration", "60"}),
                                    "cat " + out() + "/results/summary.json; ls " + out() + "/results");
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.out.find("verdict: failed: "), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find(".csv: No space left on device"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("\"force_max_n\""), std::string::npos) << "no measurements";
  EXPECT_EQ(ended.out.find(".part"), std::string::npos) << ended.out;
}

TEST_F(SmallDisk, ThatIsFullAtTheStartIsNamed) {
  const Ended ended = on_small_disk("cat /dev/zero > " + out() + "/zeros 2> " + out() + "/nothing", words({}), ":");
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.err.find("No space left on device"), std::string::npos) << ended.err;
}

TEST_F(SmallDisk, TheFolderOfARunThatIsRemovedIsNamedAndTheSummaryWritten) {
  start("lockstep", "fastdds", "60");
  if (HasFatalFailure()) return;
  std::filesystem::remove_all(out());
  EXPECT_EQ(process_->wait(), 1) << process_->err();
  EXPECT_NE(process_->out().find("was removed during the run"), std::string::npos) << process_->out();
  EXPECT_GT(summary()["haptic"][0]["steps"], 0);
}

TEST_F(RunEnds, AFullOutputEndsNoRunButIsAnError) {
  Words words = run_words(scene("press"), {"--duration", "1"});
  std::string command;
  for (const std::string& word : words) command += "'" + word + "' ";
  const Ended ended = finish({"/bin/sh", "-c", command + "> /dev/full"});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("stdout: No space left on device"), std::string::npos) << ended.err;
  EXPECT_EQ(summary()["verdict"], "ok");
}

TEST_F(RunEnds, TooFewOpenFilesAreNamed) {
  Words words = run_words(scene("press"), {"--duration", "1"});
  std::string command = "ulimit -n 16; ";
  for (const std::string& word : words) command += "'" + word + "' ";
  const Ended ended = finish({"/bin/sh", "-c", command});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("a process may open 16 files"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("ulimit -n 1024"), std::string::npos) << ended.err;
}

TEST_F(RunEnds, ATableThatNoRunHasMadeIsNotReplaced) {
  std::filesystem::create_directories(out());
  std::ofstream(out() + "/world.csv") << "country,city\n";
  const Ended refused = run(scene("press"), {"--duration", "0.1"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("world.csv, which no run has made"), std::string::npos) << refused.err;
  EXPECT_EQ(read_text(out() + "/world.csv"), "country,city\n");
  std::filesystem::remove(out() + "/world.csv");
  for (int time = 0; time < 2; ++time) EXPECT_EQ(run(scene("press"), {"--duration", "0.1", "--gui"}).code, 0);
}

TEST_F(RunEnds, ADomainsLockOfAnotherUserIsNoRun) {
  const std::string lock = "/tmp/subworld-domain-" + domain_.text() + ".lock";
  const std::string command = "touch " + lock + "; chmod 644 " + lock +
                              "; exec setpriv --reuid 65534 --regid 65534 --clear-groups '" + program("subworld") +
                              "' run '" + scene("press") + "' --duration 0.1 --domain " + domain_.text() + " --out '" +
                              out() + "/results'";
  if (getuid() != 0) GTEST_SKIP() << "needs the rights of root";
  std::filesystem::create_directories(out());
  for (const std::string& open : {folder_.path(), out()})
    std::filesystem::permissions(open, std::filesystem::perms::all);
  const Ended ended = finish({"/bin/sh", "-c", command});
  std::filesystem::remove(lock);
  EXPECT_EQ(ended.code, 0) << ended.err;
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
