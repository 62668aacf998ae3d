#include "world_sim/loops/pace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

namespace subworld {
namespace {

constexpr double kPaceCycle_s = 0.004;

/// A world whose n-th cycle has this cost, with releases from its pace, as run_realtime does.
struct Simulation {
  struct Cycle {
    double real_time_factor, late_s, idle_s, wall_s;
  };
  std::vector<Cycle> run(int cycles, const std::function<double(int)>& cost_s) {
    std::vector<Cycle> seen;
    for (int n = 0; n < cycles; ++n) {
      const double begin = std::max(now_s, release_s);
      const double idle_s = begin - now_s;
      const double deadline = release_s + pace.period_s();
      const double cost = cost_s(n);
      now_s = begin + cost;
      const double next = deadline + pace.cycle(cost, now_s - deadline);
      news.push_back(pace.take_news());
      seen.push_back({pace.real_time_factor(), now_s - deadline, idle_s, next - release_s});
      release_s = next;
    }
    return seen;
  }
  [[nodiscard]] std::vector<Pace::News> said() const {
    std::vector<Pace::News> all;
    for (const Pace::News one : news) {
      if (one != Pace::News::none) all.push_back(one);
    }
    return all;
  }

  Pace pace{kPaceCycle_s};
  double now_s = 0.0, release_s = 0.0;
  std::vector<Pace::News> news;
};

using NewsList = std::vector<Pace::News>;

void expect_smooth(const std::vector<Simulation::Cycle>& cycles) {
  double before = 1.0;
  for (std::size_t n = 0; n < cycles.size(); ++n) {
    EXPECT_LE(std::abs(cycles[n].real_time_factor / before - 1.0), Pace::kStep + 1e-9) << "cycle " << n;
    EXPECT_GE(cycles[n].real_time_factor, kLeastRealTimeFactor);
    EXPECT_LE(cycles[n].real_time_factor, 1.0);
    before = cycles[n].real_time_factor;
  }
}

TEST(Pace, AWorldThatKeepsUpHasAClockOfOne) {
  Simulation s;
  for (const auto& c : s.run(1000, [](int) { return 0.95 * kPaceCycle_s; })) {
    ASSERT_EQ(c.real_time_factor, 1.0);
    ASSERT_NEAR(c.wall_s, kPaceCycle_s, 1e-12);
  }
  EXPECT_TRUE(s.said().empty());
}

TEST(Pace, ASingleLateCycleIsCaughtUpWith) {
  Simulation s;
  for (const auto& c : s.run(1000, [](int n) { return (n % 50 == 25 ? 2.8 : 0.6) * kPaceCycle_s; })) {
    ASSERT_EQ(c.real_time_factor, 1.0);
    ASSERT_NEAR(c.wall_s, kPaceCycle_s, 1e-12);
  }
  EXPECT_TRUE(s.said().empty());
}

TEST(Pace, AHardStallIsNotCaughtUpWithAndSlowsNothing) {
  Simulation s;
  const auto cycles = s.run(200, [](int n) { return n == 100 ? 0.5 : 0.6 * kPaceCycle_s; });
  EXPECT_NEAR(cycles[100].wall_s, 0.5 - 2.0 * kPaceCycle_s, 1e-9);
  EXPECT_EQ(cycles.back().real_time_factor, 1.0);
  expect_smooth(cycles);
  EXPECT_TRUE(s.said().empty());
}

TEST(Pace, ALastingLoadSlowsTheClockToWhatTheWorldCanDoAndLeavesATenth) {
  Simulation s;
  const auto cycles = s.run(1000, [](int n) { return (n < 100 ? 0.5 : 2.275) * kPaceCycle_s; });
  expect_smooth(cycles);
  EXPECT_NEAR(cycles.back().real_time_factor, 0.9 / 2.275, 1e-3);
  for (std::size_t n = 200; n < cycles.size(); ++n) {
    EXPECT_LE(cycles[n].late_s, 0.0) << "a slowed clock is met";
    EXPECT_GE(cycles[n].idle_s, 0.099 * cycles[n].wall_s) << "others must get a part of the processor";
  }
  EXPECT_EQ(s.said(), NewsList{Pace::News::slowed});
}

TEST(Pace, AHeavyLoadIsFollowedAtOnce) {
  Simulation s;
  const auto cycles = s.run(130, [](int n) { return (n < 100 ? 0.5 : 20.0) * kPaceCycle_s; });
  EXPECT_NEAR(cycles[110].real_time_factor, 0.9 / 20.0, 1e-3) << "ten cycles of 80 ms must not become minutes";
}

TEST(Pace, RecoversToExactlyOne) {
  Simulation s;
  s.run(500, [](int) { return 20.0 * kPaceCycle_s; });
  const auto cycles = s.run(2000, [](int) { return 0.5 * kPaceCycle_s; });
  double slow_s = 0.0;
  for (const auto& c : cycles) slow_s += c.real_time_factor < 1.0 ? c.wall_s : 0.0;
  EXPECT_LT(slow_s, 2.0);
  EXPECT_EQ(cycles.back().real_time_factor, 1.0);
  EXPECT_NEAR(cycles.back().wall_s, kPaceCycle_s, 1e-12);
  EXPECT_EQ(s.said(), (NewsList{Pace::News::slowed, Pace::News::recovered}));
}

TEST(Pace, ALoadAroundACycleDoesNotMakeTheClockOscillate) {
  Simulation s;
  const auto cycles = s.run(3000, [](int n) { return (n % 2 == 0 ? 0.8 : 1.25) * kPaceCycle_s; });
  expect_smooth(cycles);
  int turns = 0;
  for (std::size_t n = 502; n < cycles.size(); ++n) {
    const double now = cycles[n].real_time_factor - cycles[n - 1].real_time_factor;
    const double before = cycles[n - 1].real_time_factor - cycles[n - 2].real_time_factor;
    turns += now * before < 0.0;
  }
  EXPECT_LT(turns, 10);
  EXPECT_LE(s.said().size(), 1U);
}

TEST(Pace, FollowsASlowOscillationOfTheLoad) {
  Simulation s;
  const auto load = [](int n) { return 2.0 + 1.5 * std::sin(2.0 * M_PI * n / 400.0); };
  const auto cycles = s.run(4000, [&](int n) { return load(n) * kPaceCycle_s; });
  expect_smooth(cycles);
  for (std::size_t n = 400; n < cycles.size(); ++n) {
    const double possible = std::min(1.0, 1.0 / load(static_cast<int>(n)));
    EXPECT_LT(cycles[n].real_time_factor, 1.25 * possible) << "cycle " << n;
    EXPECT_GT(cycles[n].real_time_factor, 0.6 * possible) << "cycle " << n;
  }
  EXPECT_LE(s.said().size(), 1U) << "a report at each oscillation is noise";
}

TEST(Pace, SaysWhereEvenTheSlowestClockIsTooFastAndStillYields) {
  Simulation s;
  const auto cycles = s.run(300, [](int) { return 100.0 * kPaceCycle_s; });
  EXPECT_EQ(cycles.back().real_time_factor, kLeastRealTimeFactor);
  EXPECT_TRUE(s.pace.stuck());
  EXPECT_GE(cycles.back().idle_s, 9.9 * kPaceCycle_s);
  EXPECT_FALSE(s.said().empty());
  EXPECT_EQ(s.said().back(), Pace::News::stuck);
  const auto after = s.run(3000, [](int) { return 0.5 * kPaceCycle_s; });
  EXPECT_EQ(after.back().real_time_factor, 1.0);
  EXPECT_EQ(s.said().back(), Pace::News::recovered);
}

}  // namespace
}  // namespace subworld
