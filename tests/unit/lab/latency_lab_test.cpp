// The search for the largest delay that a user does not notice, with errors that are known beforehand.

#include "lab/latency/limit.hpp"
#include "lab/latency/search.hpp"
#include "lab/over_link/over_link.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace subworld {
namespace {

/// RMS error of a user at a delay of so many steps.
using Errors = std::vector<std::function<double(int)>>;

struct Searched {
  std::vector<Limit> limits;  ///< by user
  std::vector<int> delays;    ///< in the order in which they were measured
};

constexpr double kStep_s = 0.001;

Searched searched(const DelayRange& range, const Errors& errors) {
  const Criteria bounds = default_bounds();
  DelaySearch search(range, errors.size());
  Searched result;
  std::vector<std::map<int, Sample>> samples(errors.size());
  while (const auto delay = search.next()) {
    std::vector<bool> within;
    for (std::size_t u = 0; u < errors.size(); ++u) {
      Sample sample{.delay_s = *delay * kStep_s, .values = {}};
      sample.values[Criterion::rms] = errors[u](*delay);
      within.push_back(!exceeded(sample.values, bounds));
      samples[u][*delay] = sample;
    }
    search.add(*delay, within);
    result.delays.push_back(*delay);
    EXPECT_LE(result.delays.size(), 2 * search.most()) << "the search does not end";
    if (result.delays.size() > 2 * search.most()) break;
  }
  for (const auto& of_user : samples) {
    std::vector<Sample> sorted;
    for (const auto& [delay, sample] : of_user) sorted.push_back(sample);
    result.limits.push_back(limit_of(sorted, bounds));
  }
  return result;
}

/// Rises through the bound at this delay.
std::function<double(int)> rising_through(double delay) {
  return [delay](int at) { return default_bounds()[Criterion::rms] * at / delay; };
}

TEST(DelaySearch, FindsTheLimitOfEachUserInAFewRuns) {
  for (const double phase : {0.0, 0.3, 0.8}) {
    const Searched found = searched({.largest = 500, .phase = phase}, {rising_through(84.5), rising_through(13.5)});
    EXPECT_LE(*found.limits[0].within_s, 0.0845);
    EXPECT_GE(*found.limits[0].within_s, 0.0845 / 1.06) << phase;
    EXPECT_NEAR(*found.limits[1].within_s, 0.013, 1e-9) << "to the step, where a step is more than the precision";
    EXPECT_LE(found.delays.size(), 34U);
    EXPECT_LT(*std::ranges::max_element(found.delays), 200) << "far beyond all limits nothing is measured";
  }
}

// 60 to 70 steps cannot be used, though the error is small beyond.
TEST(DelaySearch, StopsAtTheFirstDelayThatIsFelt) {
  const auto island = [](int delay) { return delay >= 60 && delay < 75 ? 0.1 : 0.0; };
  for (const double phase : {0.0, 0.5, 0.9}) {
    const Limit limit = searched({.largest = 500, .phase = phase}, {island}).limits[0];
    EXPECT_LT(*limit.within_s, 0.060);
    EXPECT_GE(*limit.within_s, 0.060 / 1.06);
  }
}

TEST(DelaySearch, EndsWhereNoDelayOrEveryDelayIsWithin) {
  const Searched none = searched({}, {[](int) { return 1.0; }});
  EXPECT_FALSE(none.limits[0].within_s);
  EXPECT_EQ(none.delays.size(), 3U);
  const Searched all = searched({.largest = 300}, {[](int) { return 0.0; }});
  EXPECT_EQ(*all.limits[0].within_s, 0.3);
  EXPECT_FALSE(all.limits[0].beyond);
}

// A user of whom no limit can be found does not keep the search going.
TEST(DelaySearch, NeedsNoUser) { EXPECT_EQ(searched({}, {}).delays.size(), 3U); }

TEST(Limit, IsTheCriterionThatExceedsItsBoundMost) {
  Criteria values;
  EXPECT_FALSE(exceeded(values, default_bounds()));
  values[Criterion::rms] = 0.036;
  values[Criterion::offset] = 0.012;
  EXPECT_EQ(exceeded(values, default_bounds()), Criterion::offset);
  values[Criterion::unstable] = 1.0;
  EXPECT_EQ(exceeded(values, default_bounds()), Criterion::unstable);
  values = {};
  values[Criterion::p99] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(exceeded(values, default_bounds()), Criterion::p99);
}

TEST(Limit, IsNearByTheLargestShareOfABound) {
  Criteria values;
  values[Criterion::p99] = 0.035;
  values[Criterion::offset] = 0.001;
  EXPECT_NEAR(nearness(values, default_bounds()), 0.5, 1e-12);
}

UserLimit limited(const std::string& name, double within_s, double beyond_s, double rms) {
  UserLimit user{
      .name = name, .limit = {.within_s = within_s, .beyond = {}, .limited_by = Criterion::rms}, .undecided = ""};
  user.limit.beyond = Sample{.delay_s = beyond_s, .values = {}};
  user.limit.beyond->values[Criterion::rms] = rms;
  return user;
}

std::string sentence(const std::vector<UserLimit>& users, bool finished = true) {
  return sentence_of({.scene = "row", .link = "round-trip delay", .finished = finished}, users);
}

TEST(Sentence, NamesTheLimitAndTheCriterion) {
  EXPECT_EQ(sentence({limited("hand", 0.084, 0.088, 0.036)}),
            "row: 1 user: up to 84 ms of round-trip delay cannot be felt; beyond it the RMS error is 3.6 %");
  EXPECT_EQ(
      sentence({limited("left", 0.084, 0.088, 0.036), limited("right", 0.05, 0.052, 0.04)}),
      "row: 2 users: up to 50 ms of round-trip delay cannot be felt; beyond it the RMS error is 4 % for user right");
  EXPECT_EQ(sentence({limited("hand", 0.0, 0.001, 0.08)}),
            "row: 1 user: no round-trip delay is imperceptible: already at 1 ms the RMS error is 8 %");
  EXPECT_EQ(sentence({{.name = "hand", .limit = {.within_s = 0.5, .beyond = {}, .limited_by = {}}, .undecided = ""}}),
            "row: 1 user: 500 ms of round-trip delay, the largest that was looked at, cannot be felt");
}

TEST(Sentence, SaysWhereNothingCanBeDecided) {
  const UserLimit open{.name = "right", .limit = {}, .undecided = "the reference error is larger than the bound"};
  EXPECT_EQ(sentence({open}), "row: 1 user: cannot be decided: the reference error is larger than the bound");
  EXPECT_EQ(
      sentence({limited("left", 0.084, 0.088, 0.036), open}),
      "row: 2 users: up to 84 ms of round-trip delay cannot be felt; beyond it the RMS error is 3.6 % for user left; "
      "user right cannot be decided: the reference error is larger than the bound");
  EXPECT_NE(sentence({limited("hand", 0.084, 0.3, 0.036)}, false).find("stopped before the limit was found"),
            std::string::npos);
}

TEST(Sentence, ConcludesNothingFromABusyMachine) {
  Criteria within, beyond;
  beyond[Criterion::rms] = 0.2;
  const std::vector<Sample> samples{{0.0, within}, {0.01, within}, {0.02, beyond, true}};
  const Limit limit = limit_of(samples, default_bounds());
  EXPECT_EQ(limit.within_s, 0.01);
  EXPECT_FALSE(limit.beyond);
  const std::vector<UserLimit> users{{.name = "hand", .limit = limit, .undecided = ""}};
  const std::string text = sentence_of(
      {.scene = "row", .link = "round-trip delay", .finished = false, .disturbed = "world: late cycles 0.2"}, users);
  EXPECT_EQ(
      text,
      "row: 1 user: no limit: this machine was too busy for the programs of the run (world: late cycles 0.2); up to "
      "10 ms of round-trip delay cannot be felt so far; end other programs and search again, or use a machine with "
      "more cores");
}

TEST(DeviceClock, HasTheStartAndTheDelaysOfADevice) {
  DeviceClock clock;
  // It starts at 0.25 s, and its clock stops for 0.1 s at 0.4 s of its path.
  for (double t_s = 0.0; t_s < 2.0; t_s += kStep_s) {
    clock.time_s.push_back(t_s);
    clock.device_s.push_back(std::clamp(t_s - 0.25, 0.0, 0.4) + std::max(0.0, t_s - 0.75));
  }
  EXPECT_NEAR(clock.time_of(0.0), 0.25, 2.0 * kStep_s) << "the start of the path";
  EXPECT_NEAR(clock.time_of(0.2), 0.45, kStep_s);
  EXPECT_NEAR(clock.time_of(0.3985), 0.6485, kStep_s) << "between two steps";
  EXPECT_NEAR(clock.time_of(0.5), 0.85, kStep_s);
  EXPECT_NEAR(clock.time_of(3.0), 3.35, kStep_s) << "behind the last step";
}

}  // namespace
}  // namespace subworld
