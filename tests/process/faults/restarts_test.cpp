// Programs that are started again.
#include "process/faults/ends.hpp"

#include <cmath>

namespace subworld::test {
namespace {

class RestartedByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {
 protected:
  /// Kills a program and starts it again.
  void restart() {
    start_run(GetParam().mode, GetParam().dds, {"--wait", GetParam().mode == "lockstep" ? "2" : "5"});
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
    const auto code = one.process->wait();
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
    EXPECT_EQ(one.process->wait(), 0) << one.name << ": " << one.process->err();
  }
}

// A world is halted, and another one takes its place. Once the first is continued it ends, and no user feels it.
class ContinuedWorld : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(ContinuedWorld, EndsWhereAnotherOneServesItsUsers) {
  start_run("realtime", GetParam(), {"--wait", "20"});
  if (HasFatalFailure()) return;
  world_->signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  Process& second = start("world_sim");
  const auto rows = [&] { return read_table(out() + "/haptic_0.csv").rows; };
  const auto advances = [&](std::size_t from) {
    return eventually([&] {
      const auto all = rows();
      return all.size() > from + 1500 && all.back()[0] > all[all.size() - 500][0];
    });
  };
  EXPECT_TRUE(eventually([&] { return second.out().find(" Hz") != std::string::npos; })) << second.err();
  ASSERT_TRUE(advances(rows().size())) << second.err() << haptic_->err();
  const std::size_t continued = rows().size();
  world_->signal(SIGCONT);
  EXPECT_EQ(world_->wait(20.0), 1) << world_->err();
  EXPECT_NE(world_->err().find("another world_sim serves the users of this one"), std::string::npos) << world_->err();
  EXPECT_TRUE(advances(continued)) << haptic_->err();
  const Table table = read_table(out() + "/haptic_0.csv");
  const std::size_t x = table.column("operator_force_x_n");
  double largest_n = 0.0;
  for (std::size_t i = continued; i < table.rows.size(); ++i) {
    double squared = 0.0;
    for (std::size_t k = x; k < x + 3; ++k) squared += std::pow(table.rows[i][k] - table.rows[i - 1][k], 2);
    largest_n = std::max(largest_n, std::sqrt(squared));
    EXPECT_GE(table.rows[i][0], table.rows[i - 1][0]) << "it has gone back to the first world";
  }
  EXPECT_LT(largest_n, 0.5);
  second.signal(SIGTERM);
  EXPECT_EQ(second.wait(), 0) << second.err();
  EXPECT_EQ(haptic_->wait(), 0) << haptic_->err();
  EXPECT_EQ(device_->wait(), 0) << device_->err();
}
INSTANTIATE_TEST_SUITE_P(Vendors, ContinuedWorld, ::testing::Values("fastdds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, ContinuedWorld, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });

INSTANTIATE_TEST_SUITE_P(Programs, RestartedInLockstep, ::testing::ValuesIn(losses("lockstep").other), name_of);
INSTANTIATE_TEST_SUITE_P(Full, RestartedInLockstep, ::testing::ValuesIn(losses("lockstep").half), name_of);
INSTANTIATE_TEST_SUITE_P(Programs, RestartedInRealTime, ::testing::ValuesIn(losses("realtime").half), name_of);
INSTANTIATE_TEST_SUITE_P(FullRealtime, RestartedInRealTime, ::testing::ValuesIn(losses("realtime").other), name_of);

TEST_F(RunEnds, OneThatIsStartedAgainServesItsUserToTheEndAndAddsToItsHistory) {
  start("realtime", "mixed", "5", {"--restart", "on-failure"});
  if (HasFatalFailure()) return;
  signal("haptic_sim", SIGKILL);
  EXPECT_EQ(process_->wait(), 0) << process_->err();
  const Json json = summary();
  ASSERT_EQ(json["restarts"].size(), 1U) << json["verdict"];
  EXPECT_EQ(json["restarts"][0]["program"], "haptic_sim_0");
  EXPECT_EQ(json["restarts"][0]["reason"], "killed by SIGKILL");
  ASSERT_EQ(json["world"]["absences"].size(), 1U);
  EXPECT_LT(json["world"]["absences"][0]["to_s"].get<double>(), 5.0) << "it did not return";
  const Table table = read_table(out() + "/haptic_0.csv");
  EXPECT_LT(table.rows.front()[0], 0.1) << "the rows before its death are lost";
}

// The user finds the next world, at whatever point of joining the first one died.
class KilledWhileAUserJoins : public ProcessTest, public ::testing::WithParamInterface<int> {};

TEST_P(KilledWhileAUserJoins, AWorldIsStartedAgainAndTheUserTakesPart) {
  const auto pid_of = [&](const std::string& name, const std::string& user) {
    for (const Running& one : running(out())) {
      const auto at = std::ranges::find(one.words, "--user");
      const bool same_user = user.empty() || (at != one.words.end() && *(at + 1) == user);
      if (one.words.front().ends_with("/" + name) && same_user) return one.pid;
    }
    return pid_t{0};
  };
  Process process(run_words(scene("lift"), {"--mode", "realtime", "--duration", "6", "--set", "users.budget_ratio=0.3",
                                            "--restart", "on-failure", "--checkpoint", "0.1"}),
                  folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_1.csv").size() > 100000; })) << process.err();
  const pid_t first = pid_of("haptic_sim", "1");
  ASSERT_GT(first, 0);
  kill(first, SIGKILL);
  ASSERT_TRUE(eventually([&] {
    const pid_t now = pid_of("haptic_sim", "1");
    return now > 0 && now != first;
  }));
  std::this_thread::sleep_for(std::chrono::milliseconds(GetParam()));
  const pid_t world = pid_of("world_sim", "");
  ASSERT_GT(world, 0);
  kill(world, SIGKILL);
  EXPECT_EQ(process.wait(), 0) << process.err() << process.out();
  const Json json = summary();
  EXPECT_EQ(json["restarts"].size(), 2U) << json["verdict"];
  EXPECT_NEAR(json["simulated_s"].get<double>(), 6.0, 0.01);
  for (const Json& absence : json["world"]["absences"]) EXPECT_LT(absence["to_s"].get<double>(), 5.0) << absence;
  for (const Json& haptic : json["haptic"]) EXPECT_GT(haptic["ending"]["to_s"].get<double>(), 5.7) << haptic["user"];
}
INSTANTIATE_TEST_SUITE_P(Delays_ms, KilledWhileAUserJoins, ::testing::Values(60));
INSTANTIATE_TEST_SUITE_P(FullRealtime, KilledWhileAUserJoins, ::testing::Values(300));

// It fails after it has written its results.
TEST_F(ProcessTest, AWorldAtItsEndIsNotStartedAgain) {
  const std::string programs = folder_.path() + "/bin", starts = folder_.path() + "/starts";
  std::filesystem::create_directory(programs);
  for (const auto& entry : std::filesystem::directory_iterator(PROGRAMS_FOLDER)) {
    const std::string name = entry.path().filename().string();
    if (name == "subworld") std::filesystem::copy_file(entry.path(), programs + "/" + name);
    if (name != "subworld" && name != "world_sim") std::filesystem::create_symlink(entry.path(), programs + "/" + name);
  }
  const std::string world = folder_.write(
      "bin/world_sim", "#!/bin/sh\necho >> " + starts + "\n" + program("world_sim") + " \"$@\"\nexit 1\n");
  std::filesystem::permissions(world, std::filesystem::perms::owner_all);
  Words words = run_words(scene("press"), {"--mode", "realtime", "--duration", "1", "--restart", "on-failure"});
  words.front() = programs + "/subworld";
  const Ended ended = finish(words);
  EXPECT_EQ(ended.code, 1) << ended.err << ended.out;
  EXPECT_EQ(read_text(starts), "\n") << ended.err;
}

TEST_F(ProcessTest, InLockstepNothingIsStartedAgainUnlessTheRunWaitsOrContinues) {
  const Ended ended = finish(run_words(scene("press"), {"--restart", "always"}));
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("--restart: a run in lock-step ends with the first of its programs; give --absent wait"),
            std::string::npos)
      << ended.err;
}

}  // namespace
}  // namespace subworld::test
