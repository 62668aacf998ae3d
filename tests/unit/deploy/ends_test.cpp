#include "judge/ends.hpp"

#include "judge/summary.hpp"
#include "rt/presence.hpp"
#include "run/supervise.hpp"
#include "watch/watchdog.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace subworld {
namespace {

Ending ending(const char* by, double to_s) { return {.session = 1, .to_s = to_s, .by = by}; }

/// Results of a complete run of one user.
RunResults whole_run() {
  RunResults run;
  run.scene.settings.duration_s = 8.0;
  run.ending = ending("duration", 8.0);
  run.haptic.resize(1);
  run.haptic[0].ending = ending("last frame", 7.99);
  run.device.resize(1);
  run.device[0].ending = ending("last command", 8.3);
  return run;
}

void expect_fault(const RunResults& run, const std::string& words) {
  const auto faults = faults_of(run);
  ASSERT_EQ(faults.size(), 1U) << words;
  EXPECT_NE(faults[0].find(words), std::string::npos) << faults[0];
}

TEST(Faults, AWholeRunHasNone) { EXPECT_TRUE(faults_of(whole_run()).empty()); }

TEST(Faults, NameWhoWasStopped) {
  RunResults run = whole_run();
  run.device[0].ending = ending("SIGTERM", 2.9);
  expect_fault(run, "device_sim_0 was stopped by SIGTERM at t = 2.900 of 8 s");
}

TEST(Faults, NameAUserWhoWasNotServedToTheEnd) {
  RunResults run = whole_run();
  run.haptic[0].ending.to_s = 2.9;
  expect_fault(run, "haptic_sim_0 served its user from 0.000 to 2.900 s, the world ran to 8.000 s");
  run = whole_run();
  run.haptic[0].ending.from_s = 1.0;
  expect_fault(run, "haptic_sim_0 served its user from 1.000");
}

TEST(Faults, AUserWhoReturnsOrIsAskedToLeaveIsNone) {
  RunResults run = whole_run();
  run.haptic[0].ending.from_s = 3.1;
  run.world.absences = {{.user = 0, .from_s = 2.6, .to_s = 3.2}};
  EXPECT_TRUE(faults_of(run).empty());
  run.world.absences[0].to_s = 6.0;
  expect_fault(run, "haptic_sim_0 served its user from 3.100");
  run = whole_run();
  run.haptic[0].ending.to_s = 2.6;
  run.world.absences = {{.user = 0, .from_s = 2.6, .to_s = 8.0, .by_order = true}};
  EXPECT_TRUE(faults_of(run).empty());
}

TEST(Faults, NameWhoWasInAnotherRun) {
  RunResults run = whole_run();
  run.haptic[0].ending.session = 2;
  expect_fault(run, "haptic_sim_0 took part in another world's run");
}

TEST(Faults, AnOrderedStopIsNone) {
  RunResults run = whole_run();
  run.ending = ending("control", 3.0);
  run.haptic[0].ending.to_s = 2.99;
  EXPECT_TRUE(faults_of(run).empty());
}

Status status_of(ProgramKind program, double time_s) {
  Status status;
  status.program = program;
  status.state = "running";
  status.steps = 1;
  status.time_s = time_s;
  return status;
}

/// Observes once a second a world that advances and a haptic process that does not.
class WatchdogTest : public ::testing::Test {
 protected:
  std::vector<std::string> watch(int seconds, const Status& stands, bool paused = false) {
    std::vector<std::string> said;
    for (int i = 0; i < seconds; ++i) {
      now_s_ += 1.0;
      Status world = status_of(ProgramKind::world_sim, now_s_);
      world.paused = paused;
      for (const Status& status : {world, stands}) {
        if (auto text = watchdog_.observe(status, now_s_); !text.empty()) said.push_back(std::move(text));
      }
    }
    return said;
  }

  Watchdog watchdog_;
  double now_s_ = 0.0;
  Status stands_ = status_of(ProgramKind::haptic_sim, 1.5);
};

TEST_F(WatchdogTest, NamesAProgramThatDoesNotAdvanceOnce) {
  const auto said = watch(20, stands_);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_TRUE(said[0].starts_with("haptic_sim_0 has not advanced from t = 1.500 s for 4 s")) << said[0];
  EXPECT_EQ(watchdog_.longest().label, "haptic_sim_0");
  EXPECT_GT(watchdog_.longest().for_s, 15.0);
  stands_.time_s = 1.6;
  const auto after = watch(1, stands_);
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(after[0], "haptic_sim_0 advances again");
}

TEST_F(WatchdogTest, SaysNothingOfOneThatWaitsIsPausedOrHasNotBegun) {
  stands_.waits_for = "world_sim";
  EXPECT_TRUE(watch(20, stands_).empty());
  stands_.waits_for.clear();
  EXPECT_TRUE(watch(20, stands_, true).empty());
  EXPECT_TRUE(watch(3, stands_).empty()) << "the time of the pause does not count";
  stands_.steps = 0;
  EXPECT_TRUE(watch(20, stands_).empty());
  stands_.steps = 1;
  stands_.state = "stopping";
  EXPECT_TRUE(watch(20, stands_).empty());
  EXPECT_EQ(watchdog_.longest().for_s, 0.0);
}

TEST_F(WatchdogTest, JudgesByWhatArrives) {
  watch(1, stands_);
  now_s_ += 60.0;  // the launcher itself was suspended
  stands_.time_s = 61.0;
  EXPECT_TRUE(watch(2, stands_).empty());
  EXPECT_TRUE(watch(2, stands_).empty());
  EXPECT_EQ(watch(2, stands_).size(), 1U);
}

TEST(PresenceTest, APeerIsGoneThatIsNeitherHeardNorAliveForLong) {
  Presence silent, alive, heard;
  for (int ms = 0; ms < 2500; ++ms) {
    silent.observe(false, false, 1e-3);
    alive.observe(false, true, 1e-3);
    heard.observe(ms % 1000 == 0, false, 1e-3);
    EXPECT_FALSE(silent.gone() && ms < 1990) << ms;
  }
  EXPECT_TRUE(silent.gone());
  EXPECT_FALSE(alive.gone());
  EXPECT_FALSE(heard.gone());
  alive.observe(false, false, 1e-3);
  EXPECT_TRUE(alive.gone());
}

TEST(Ends, AProgramBehindSshThatWasKilledSaysSo) {
  constexpr int kSshFailedStatus = kSshFailed << 8;  // as waitpid() has it
  Supervisor::Child child;
  child.process.status = kSshFailedStatus;
  EXPECT_EQ(end_of(child), "exited with 255");
  child.program.host = "right";
  EXPECT_EQ(end_of(child), "was killed there, or ssh lost the connection to it");
}

}  // namespace
}  // namespace subworld
