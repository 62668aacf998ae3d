#include "ends.hpp"
#include "rt/presence.hpp"
#include "summary.hpp"
#include "watchdog.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

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

/// Observes once a second a world and a haptic process, one of which does not advance.
std::vector<std::string> watch(Watchdog& watchdog, int seconds, const Sighting& stands, bool paused = false) {
  std::vector<std::string> said;
  static double time_s = 0.0;
  for (int i = 0; i < seconds; ++i) {
    time_s += 1.0;
    const Sighting goes{stands.label == "world_sim" ? "haptic_sim_0" : "world_sim", time_s, ""};
    for (auto& line : watchdog.look({stands, goes}, paused, 1.0)) said.push_back(std::move(line));
  }
  return said;
}

TEST(WatchdogTest, NamesAProgramThatDoesNotAdvanceOnce) {
  Watchdog watchdog;
  const auto said = watch(watchdog, 20, {"haptic_sim_0", 1.5, ""});
  ASSERT_EQ(said.size(), 1U);
  EXPECT_TRUE(said[0].starts_with("haptic_sim_0 has not advanced from t = 1.500 s")) << said[0];
  EXPECT_EQ(watchdog.longest().label, "haptic_sim_0");
  EXPECT_GT(watchdog.longest().for_s, 15.0);
  const auto after = watch(watchdog, 1, {"haptic_sim_0", 1.6, ""});
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(after[0], "haptic_sim_0 advances again");
}

TEST(WatchdogTest, SaysNothingOfOneThatWaitsIsPausedOrHasNotBegun) {
  Watchdog watchdog;
  EXPECT_TRUE(watch(watchdog, 20, {"haptic_sim_0", 1.5, "world_sim"}).empty());
  EXPECT_TRUE(watch(watchdog, 20, {"haptic_sim_0", 1.5, ""}, true).empty());
  EXPECT_TRUE(watch(watchdog, 20, {"haptic_sim_0", -1.0, ""}).empty());
  EXPECT_EQ(watchdog.longest().for_s, 0.0);
}

TEST(Logs, SayWhoWaitsAndWhetherAWorldIsPaused) {
  const std::string file = testing::TempDir() + "/ends_test.log";
  const auto write = [&](const char* text) { std::ofstream(file) << text; };
  write("world_sim: waits for haptic_sim 1\n");
  EXPECT_EQ(waits_for(file), "haptic_sim 1");
  write("world_sim: waits for haptic_sim 1\nworld_sim: haptic_sim 1 is there again\n");
  EXPECT_EQ(waits_for(file), "");
  write("world_sim: control 5: paused\n");
  EXPECT_TRUE(is_paused(file));
  write("world_sim: control 5: paused\nworld_sim: control 6: resumed\n");
  EXPECT_FALSE(is_paused(file));
  write("time_s,x_m\n0.1,2\n0.2,2\n0.3");
  EXPECT_EQ(last_time_s(file), 0.2);
  write("time_s,x_m\n");
  EXPECT_LT(last_time_s(file), 0.0);
  std::remove(file.c_str());
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

}  // namespace
}  // namespace subworld
