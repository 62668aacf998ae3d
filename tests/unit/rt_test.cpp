#include "rt/arrears.hpp"
#include "rt/cyclic.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace subworld {
namespace {

using namespace std::chrono_literals;

TEST(Cyclic, LeavesOutWhatIsOverAndKeepsItsGrid) {
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

// A step that takes longer than its period for good: every other period is lost, and the clock still keeps up.
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

}  // namespace
}  // namespace subworld
