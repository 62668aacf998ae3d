#include "process/process_test.hpp"
#include "support/grid.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <thread>

namespace subworld::test {
namespace {

constexpr double kForceLimit_n = 40.0;  // of scene press

class Overload : public ProcessTest {};
class ShortDelay : public ProcessTest {};
class RealTimeDelay : public ProcessTest, public ::testing::WithParamInterface<std::string> {};

class RealTime : public ProcessTest, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

TEST_P(RealTime, RunsForItsTimeAndEnds) {
  const auto& [scheme, dds] = GetParam();
  const Ended ended = run(scene("press"), {"--mode", "realtime", "--duration", "1", "--dds", dds, "--scheme", scheme});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  const Json& haptic = json["haptic"][0];
  EXPECT_EQ(json["mode"], "realtime");
  EXPECT_NEAR(json["simulated_s"].get<double>(), 1.0, 1e-6);
  // A machine that took time away makes the loop skip steps.
  EXPECT_GE(haptic["steps"].get<int>() + haptic["skipped_steps"].get<int>(), 990);
  // A shared machine may delay a process for more frames than a reader stores; a fault loses frames all the time.
  EXPECT_LE(haptic["lost_frames"].get<double>(), 0.05 * json["world"]["cycles"].get<double>());
  EXPECT_GT(haptic["force_max_n"], 1.0);  // the cube was pressed

  const Table table = read_table(out() + "/haptic_0.csv");
  ASSERT_EQ(table.rows.size(), haptic["steps"].get<std::size_t>());
  EXPECT_LT(table.rows.front().front(), 0.1) << "the world went ahead without the user";
  const std::size_t felt = table.column("force_x_n"), commanded = table.column("operator_force_x_n");
  const auto norm = [](const std::vector<double>& row, std::size_t at) {
    return std::hypot(row[at], row[at + 1], row[at + 2]);
  };
  for (const auto& row : table.rows) {
    for (const double value : row) ASSERT_TRUE(std::isfinite(value));
    ASSERT_LE(norm(row, felt), kForceLimit_n * (1.0 + 1e-9));
    ASSERT_LE(norm(row, commanded), kForceLimit_n * (1.0 + 1e-9));
  }
  // The operator feels no force at first, and none after the release.
  EXPECT_NEAR(norm(table.rows.front(), commanded), 0.0, 0.01 * kForceLimit_n);
  const Table device = read_table(out() + "/device_0.csv");
  EXPECT_GT(device.rows.front().front(), 0.0) << "a device that waits for its haptic loop has no steps";
  EXPECT_EQ(norm(device.rows.front(), device.column("force_x_n")), 0.0)
      << device.rows.size() << " rows, the first of " << device.rows.front().front() << " s";
  EXPECT_NEAR(norm(device.rows.back(), device.column("force_x_n")), 0.0, 0.05 * kForceLimit_n);
}

const auto kRuns = halves<std::string, std::string>({"reduced", "paper"}, {"fastdds", "cyclonedds", "mixed"});
std::string name_of_run(const ::testing::TestParamInfo<std::tuple<std::string, std::string>>& one) {
  return std::get<0>(one.param) + "_" + std::get<1>(one.param);
}
INSTANTIATE_TEST_SUITE_P(Vendors, RealTime, ::testing::ValuesIn(kRuns.half), name_of_run);
INSTANTIATE_TEST_SUITE_P(FullRealtime, RealTime, ::testing::ValuesIn(kRuns.other), name_of_run);

// Each message takes the delay of the settings, and the world uses what the operator did in time.
TEST_P(RealTimeDelay, OfTheSettingsActsOnOneMachine) {
  const Ended ended = run(scene("lift"), {"--mode", "realtime", "--duration", "2", "--latency", "0.1", "--set",
                                          "delay.device_latency_s=0.02", "--dds", GetParam()});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  for (const char* program : {"haptic", "device"}) {
    const double least_s = program == std::string("haptic") ? 0.1 : 0.02;
    for (const Json& one : json[program]) {
      EXPECT_GE(one["round_trip_s"]["p50"].get<double>(), least_s) << one;
      EXPECT_LE(one["round_trip_s"]["p50"].get<double>(), least_s + 0.05) << one;
    }
  }
  EXPECT_NEAR(json["simulated_s"].get<double>(), 2.0, 1e-6);
  EXPECT_NE(json["verdict"].get<std::string>().find("artificial delay 100 ms"), std::string::npos) << json["verdict"];
  const Table table = read_table(out() + "/haptic_0.csv");
  const std::size_t device = table.column("device_time_s");
  EXPECT_GT(table.rows.back()[device], 1.5) << "the device's states arrive";
}
INSTANTIATE_TEST_SUITE_P(Vendors, RealTimeDelay, ::testing::Values("fastdds", "cyclonedds"));

TEST_F(ShortDelay, IsThatOfARunInRealTime) {
  const Ended ended = run(scene("lift"), {"--mode", "realtime", "--latency", "0.6"});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("in real time it may be 0.5 s: reduce --latency"), std::string::npos) << ended.err;
}

// A sub-world that is too slow continues from the world's newest state. It neither freezes nor catches up.
TEST_F(Overload, OfTheSubWorldEndsWithTheWorld) {
  const Ended ended =
      run(overloaded_heap(), {"--mode", "realtime", "--duration", "3", "--set", "haptic.preset=quality"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  EXPECT_NEAR(json["simulated_s"].get<double>(), 3.0, 0.01);
  const double wall_s = 3.0 / json["world"]["real_time_factor_mean"].get<double>();
  EXPECT_LE(json["haptic"][0]["steps"].get<double>(), 1500.0 * wall_s) << "more steps than there was time for";
  EXPECT_NE(ended.out.find(": MISSED: steps take "), std::string::npos) << ended.out;
  // With so few steps the force may also oscillate, or the bodies gain energy, which a verdict names first.
  const auto verdict = json["verdict"].get<std::string>();
  EXPECT_TRUE(verdict.starts_with("unstable: ") || verdict.starts_with("quality gate missed: ")) << ended.out;
}

// A world that is too slow lowers its real-time factor, reports it, and recovers; the haptic loop runs at its rate.
TEST_F(Overload, OfTheWorldSlowsTheClockForAWhile) {
  const Ended ended = run(scene("press"), {"--mode", "realtime", "--engine", "busy", "--duration", "3"},
                          {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const std::string said = read_text(out() + "/logs/world_sim.log");
  for (const char* words : {"the world needs ", " ms of a 4 ms cycle: its clock runs at 0.", "keeps up again"})
    EXPECT_NE(said.find(words), std::string::npos) << words << " is not in: " << said;
  EXPECT_NE(ended.out.find("the clock was slowed for "), std::string::npos) << ended.out;

  const Json json = summary();
  const Json& world = json["world"];
  EXPECT_NEAR(json["simulated_s"].get<double>(), 3.0, 1e-6);
  EXPECT_LT(world["real_time_factor_min"], 0.25) << "20 ms of a 4 ms cycle";
  EXPECT_LT(world["real_time_factor_mean"], 0.7);
  EXPECT_GT(world["slowed_s"], 3.0);
  EXPECT_EQ(world["stuck_s"], 0.0);
  const Table cycles = read_table(out() + "/world.csv");
  const std::size_t factor = cycles.column("real_time_factor");
  EXPECT_TRUE(std::ranges::any_of(cycles.rows, [&](const auto& row) { return row[0] > 2.0 && row[factor] == 1.0; }))
      << "no recovery";

  // One simulated second took five, with a force in each millisecond.
  EXPECT_GT(json["haptic"][0]["steps"].get<double>() + json["haptic"][0]["skipped_steps"].get<double>(), 6000.0);
  const Table felt = read_table(out() + "/haptic_0.csv");
  std::size_t stands = 0, most = 0;
  for (std::size_t i = 1; i < felt.rows.size(); ++i) {
    const double passed_s = felt.rows[i][0] - felt.rows[i - 1][0];
    EXPECT_GE(passed_s, 0.0) << "back in time at " << felt.rows[i][0];
    if (felt.rows[i][0] < 2.9) most = std::max(most, stands = passed_s > 0.0 ? 0 : stands + 1);
  }
  EXPECT_LT(most, 200U) << "steps without time: the haptic clock stood";
}

TEST_F(Overload, UsersShareTheCoresOfTheMachine) {
  const double cores = std::thread::hardware_concurrency();
  const double expected = std::clamp(0.5 * (cores - 4 * 0.258) / 4, 0.02, 0.4);
  const Ended ended = run(scene("carry"), {"--mode", "realtime", "--duration", "0.3"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.out.find("4 users share") != std::string::npos, expected < 0.4) << ended.out;
  const Json users = summary()["settings"]["users"];
  EXPECT_EQ(users.size(), 4U);
  for (const Json& user : users) EXPECT_NEAR(user["selection"]["budget_ratio"], expected, 1e-6);
  const Ended chosen =
      run(scene("carry"), {"--mode", "realtime", "--duration", "0.3", "--set", "users.budget_ratio=0.3"});
  EXPECT_EQ(chosen.code, 0) << chosen.err;
  for (const Json& user : summary()["settings"]["users"]) EXPECT_EQ(user["selection"]["budget_ratio"], 0.3);
}

}  // namespace
}  // namespace subworld::test
