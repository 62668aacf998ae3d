#include "rt/arrears.hpp"
#include "rt/calibration.hpp"
#include "rt/cyclic.hpp"
#include "rt/kernel_share.hpp"
#include "rt/lateness.hpp"
#include "rt/stages.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

namespace subworld {
namespace {

using namespace std::chrono_literals;

TEST(Cyclic, SkipsPeriodsThatAreOverAndStaysOnItsGrid) {
  const TimePoint start = Clock::now() - 1ms;
  Cyclic loop(start, 1ms);
  loop.wait();
  EXPECT_EQ(loop.skip(start + 999us), 0);
  EXPECT_EQ(loop.released(), start);
  EXPECT_EQ(loop.skip(start + 1ms), 1) << "a period is over when the next one begins";
  EXPECT_EQ(loop.skip(start + 7500us), 6);
  EXPECT_EQ(loop.released(), start + 7ms);
  EXPECT_EQ(loop.deadline(), start + 8ms);
}

TEST(Cyclic, SpinsToTheReleaseAndNeverWakesEarly) {
  Cyclic loop(Clock::now() + 2ms, 1ms, 500us);
  for (int i = 0; i < 20; ++i) {
    EXPECT_GE(loop.wait(), Duration::zero());
    EXPECT_GE(Clock::now(), loop.released());
  }
}

TEST(Arrears, CyclesEndWithAStepAndNoTimeIsLost) {
  constexpr double h = 1e-3;
  for (const double rate : {1.0, 0.97, 0.6, 0.31}) {
    for (const int ratio : {1, 4, 20}) {
      Arrears arrears;
      double asked_s = 0.0;
      double made_s = 0.0;
      for (int cycle = 0; cycle < 200; ++cycle) {
        double left_s = ratio * h;
        while (left_s > 1e-6 * h) {
          const double dt = arrears.step(rate * h, left_s);
          EXPECT_GE(dt, 0.5 * rate * h - 1e-12);
          EXPECT_LE(dt, 2.5 * rate * h + 1e-12);
          left_s -= dt;
          asked_s += rate * h;
          made_s += dt;
        }
        EXPECT_NEAR(left_s, 0.0, 1e-12) << "rate " << rate << ", ratio " << ratio;
      }
      EXPECT_NEAR(asked_s - made_s, arrears.owed_s(), 1e-9);
      EXPECT_LE(std::abs(arrears.owed_s()), 4.0 * h) << "rate " << rate << ", ratio " << ratio;
    }
  }
}

TEST(Arrears, AreMadeUpForGently) {
  constexpr double h = 1e-3;
  Arrears arrears;
  arrears.owe(3.0 * h);
  double longest_s = 0.0;
  for (int step = 0; step < 40; ++step) longest_s = std::max(longest_s, arrears.step(h, 1.0));
  EXPECT_LE(longest_s, 1.5 * h);
  EXPECT_LT(arrears.owed_s(), 0.05 * h);
}

// The cores are too few then, and steps without motion cost little.
TEST(Arrears, ASlowedClockMovesInWholeStepsAndLosesNoTime) {
  constexpr double kStep = 0.001, kCycle = 0.004;
  for (const double rate : {0.8, 0.31, 0.02}) {
    Arrears arrears;
    arrears.owe(0.003);
    double passed = 0.0, in_cycle = 0.0;
    int moved = 0;
    for (int i = 0; i < 5000; ++i) {
      const double dt = arrears.step(rate * kStep, kCycle - in_cycle, kStep);
      if (dt == 0.0) continue;
      EXPECT_NEAR(dt, kStep, 1e-9);
      ++moved;
      passed += dt;
      in_cycle = in_cycle + dt < kCycle - 1e-9 ? in_cycle + dt : 0.0;
    }
    EXPECT_NEAR(passed + arrears.owed_s(), 0.003 + 5000 * rate * kStep, 1e-9) << rate;
    EXPECT_LE(moved, 5000 * rate + 4) << rate;
  }
}

// A step that always takes longer than its period: every other period is lost, and the clock still stays correct.
TEST(Arrears, AStandingOverloadIsCarried) {
  constexpr double h = 1e-3;
  Arrears arrears;
  for (int step = 0; step < 1000; ++step) {
    arrears.owe(h);
    arrears.step(h, 1.0);
  }
  EXPECT_LE(arrears.owed_s(), 8.0 * h + 1e-9);
}

TEST(Arrears, AClockThatStandsOwesNothing) {
  Arrears arrears;
  arrears.owe(2e-3);
  EXPECT_EQ(arrears.step(0.0, 4e-3), 0.0);
  EXPECT_EQ(arrears.owed_s(), 2e-3);
  arrears.forget();
  EXPECT_EQ(arrears.step(1e-3, 4e-3), 1e-3);
}

/// A loop of 1 ms with simulated use of the core. Each step is (asked, woke, done), in us after the first release, with
/// its CPU time and number of sleeps.
class LatenessOf1kHz : public ::testing::Test {
 protected:
  struct Step {
    int asked_us, woke_us, done_us, cpu_us;
    std::uint64_t waits = 0;  ///< in addition to the sleep until the release
  };

  Miss step(int release, const Step& s) {
    const TimePoint released = at(1000 * release);
    skipped_by_os_ = lateness_.begin(released, at(s.asked_us), at(s.woke_us), 1ms);
    use_.cpu += std::chrono::microseconds(s.cpu_us);
    use_.blocked += (s.asked_us < 1000 * release ? 1 : 0) + s.waits;
    const Miss miss = lateness_.judge(at(s.done_us), released + 1ms, use_);
    lateness_.end(at(s.done_us), use_);
    return miss;
  }
  static TimePoint at(int us) { return TimePoint(1h) + std::chrono::microseconds(us); }

  ThreadUse use_;
  Lateness lateness_{use_};
  int skipped_by_os_ = 0;
};

TEST_F(LatenessOf1kHz, AStepInTimeIsNoMiss) { EXPECT_EQ(step(0, {-500, 10, 900, 890}), Miss::none); }

TEST_F(LatenessOf1kHz, ALateWakeUpIsOfTheOs) { EXPECT_EQ(step(0, {-500, 700, 1100, 400}), Miss::os); }

// Without the 50 us it would also have been late.
TEST_F(LatenessOf1kHz, ALongStepIsOfTheRunThoughItsWakeUpWasALittleLate) {
  EXPECT_EQ(step(0, {-500, 50, 1350, 1300}), Miss::computing);
}

TEST_F(LatenessOf1kHz, APreEmptionIsOfTheOs) { EXPECT_EQ(step(0, {-500, 10, 1100, 400}), Miss::os); }

TEST_F(LatenessOf1kHz, AStepThatWaitsForALockIsOfTheRun) {
  EXPECT_EQ(step(0, {-500, 10, 1100, 400, 1}), Miss::waiting);
}

// A cause that makes one step late also makes the next one late, and the miss has the same cause.
TEST_F(LatenessOf1kHz, TheCauseOfALateStepIsTheCauseOfTheNextOne) {
  EXPECT_EQ(step(0, {-500, 1500, 1900, 400}), Miss::os);
  EXPECT_EQ(step(1, {1901, 1902, 2302, 400}), Miss::os);
  EXPECT_EQ(step(2, {2303, 2304, 2704, 400}), Miss::none);
  EXPECT_EQ(step(3, {2705, 3010, 4910, 1900}), Miss::computing);
  EXPECT_EQ(step(4, {4911, 4912, 5312, 400}), Miss::computing);
}

TEST_F(LatenessOf1kHz, PeriodsThatPassAreSharedOut) {
  step(0, {-500, 3200, 3300, 100});
  EXPECT_EQ(skipped_by_os_, 3) << "woken 3.2 ms late";
  step(4, {3400, 4010, 6900, 2890});
  step(5, {6901, 6902, 7000, 90});
  EXPECT_EQ(skipped_by_os_, 0) << "a step of 2.9 ms is missed by the run";
}

TEST(Misses, AreCountedOnceAndForOne) {
  Misses misses;
  for (const Miss miss : {Miss::none, Miss::os, Miss::computing, Miss::waiting}) misses.add(miss);
  misses.skip(5, 3);
  EXPECT_EQ(misses.all(), 8U);
  EXPECT_EQ(misses.by_os, 4U);
  EXPECT_EQ(misses.by_run, 4U);
  EXPECT_EQ(misses.waiting, 1U);
}

TEST(Histogram, CountsWhatIsLongerAndAddsUp) {
  Histogram one, other;
  for (int i = 1; i <= 10; ++i) one.add(1e-3 * i);
  other.add(1.0);
  one.add(other);
  EXPECT_EQ(one.count(), 11U);
  EXPECT_EQ(one.count_above(5.5e-3), 6U);
  EXPECT_EQ(one.count_above(2.0), 0U);
  EXPECT_EQ(one.max_s(), 1.0);
}

TEST(Calibration, WakesEachLoopAtItsRate) {
  const Calibration found = calibrate(2, 0.01, 0.2);
  EXPECT_EQ(found.loops, 2);
  EXPECT_GE(found.lateness.count(), 2U);
  EXPECT_LE(found.lateness.count(), 2U * 21U);
  EXPECT_GE(found.lateness.quantile_s(0.5), 0.0);
  EXPECT_FALSE(found.granted.text.empty());
}

enum class Stage : std::uint8_t { wake, work, rest, count };

TEST(Stages, AddUpWhatAStageTookInAStep) {
  Stages<Stage> stages;
  const TimePoint release = Clock::now() - 5ms;
  stages.begin(release, release + 1ms);
  stages.mark(Stage::work);
  stages.mark(Stage::rest);
  const TimePoint last = stages.mark(Stage::work);
  const StageStep step = stages.end();
  EXPECT_EQ(step.begin, release);
  EXPECT_EQ(step.end, last);
  ASSERT_EQ(step.stretches.size(), 4U);
  TimePoint at = step.begin;
  for (const StageStretch& stretch : step.stretches) {
    EXPECT_EQ(stretch.begin, at) << "a gap";
    at = stretch.end;
  }
  EXPECT_EQ(at, step.end);
  const auto times = stages.times();
  EXPECT_EQ(times[0].count(), 1U);
  EXPECT_NEAR(times[0].mean_s(), 1e-3, 1e-9);
  EXPECT_EQ(times[1].count(), 1U) << "two stretches of one step are one time";
  EXPECT_GE(times[1].mean_s(), 4e-3);
}

TEST(Stages, DoNotBeginAStepBeforeTheOneBeforeHasEnded) {
  Stages<Stage> stages;
  const TimePoint release = Clock::now() - 5ms;
  stages.begin(release, release + 1ms);
  const TimePoint end = stages.mark(Stage::work);
  stages.end();
  stages.begin(release + 1ms, end + 1ms);  // released while the first step was still running
  const StageStep step = stages.end();
  EXPECT_EQ(step.begin, end);
  EXPECT_EQ(step.end, end + 1ms);
}

TEST(Stages, OfAStepThatDidNotComeHaveNoTime) {
  Stages<Stage> stages;
  for (int i = 0; i < 3; ++i) {
    stages.begin(Clock::now(), Clock::now());
    stages.mark(Stage::work);
    stages.end();
  }
  EXPECT_EQ(stages.times()[2].count(), 0U);
}

// The kernel counts a process's children also across execve(), here 1100 s of a build before the run.
TEST(CoreLoad, CountsTheRunAlone) {
  const CoreLoad load = core_load({500.0, 1.0, 1100.0}, {512.0, 2.0, 1109.0}, 10.0, 2);
  EXPECT_DOUBLE_EQ(load.own, 0.9);
  EXPECT_DOUBLE_EQ(load.other, 0.3);
  EXPECT_DOUBLE_EQ(load.stolen, 0.1);
}

TEST(CoreLoad, IsWithinTheMachine) {
  for (const auto& [own_s, busy_s, stolen_s, wall_s] :
       {std::array{30.0, 5.0, 40.0, 10.0}, std::array{-3.0, -5.0, -1.0, 10.0}, std::array{1.0, 90.0, 0.0, 0.0},
        std::array{0.0, 1000.0, 3.0, 10.0}}) {
    const CoreLoad load = core_load({}, {busy_s, stolen_s, own_s}, wall_s, 2);
    for (const double part : {load.own, load.other, load.stolen}) EXPECT_GE(part, 0.0);
    EXPECT_LE(load.own + load.other + load.stolen, 2.0 + 1e-9);
  }
}

TEST(CpuQuota, IsTheSmallestOfAllControlGroups) {
  const TemporaryFolder root;
  const auto write = [&](const std::string& file, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(root.path() + file).parent_path());
    std::ofstream(root.path() + file) << text;
  };
  write("/proc/self/cgroup", "3:cpuset:/\n2:cpu,cpuacct:/box\n0::/user.slice/shell\n");
  write("/sys/fs/cgroup/user.slice/shell/cpu.max", "max 100000\n");
  EXPECT_FALSE(cpu_quota(root.path()));
  write("/sys/fs/cgroup/user.slice/cpu.max", "150000 100000\n");
  EXPECT_DOUBLE_EQ(cpu_quota(root.path()).value().cores, 1.5);
  write("/sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_quota_us", "30000\n");
  write("/sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_period_us", "100000\n");
  const CpuQuota quota = cpu_quota(root.path()).value();
  EXPECT_DOUBLE_EQ(quota.cores, 0.3);
  EXPECT_TRUE(quota.file.ends_with("/cpu.cfs_quota_us")) << quota.file;
}

TEST(CoreLoad, OfThisProcessIsMeasured) {
  const MachineUse from = machine_use();
  const TimePoint until = Clock::now() + from_seconds(0.05);
  while (Clock::now() < until) {
  }
  const CoreLoad load = core_load(from, machine_use(), 0.05, 64);
  EXPECT_GT(load.own, 0.0);
  EXPECT_LT(load.own, 2.0);
}

}  // namespace
}  // namespace subworld
