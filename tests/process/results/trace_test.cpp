#include "process/process_test.hpp"

#include <filesystem>
#include <map>
#include <set>

namespace subworld::test {
namespace {

constexpr double kRounding_us = 0.002;  // of a time and of a duration

/// The stages of each program, as in its part of the summary.
std::map<std::string, std::set<std::string>> stages_of(const Json& summary) {
  const auto names = [](const Json& part) {
    std::set<std::string> all;
    for (const auto& [name, times] : part["stages"].items()) all.insert(name.substr(0, name.size() - 2));
    return all;
  };
  return {{"world_sim", names(summary["world"])},
          {"haptic_sim 0", names(summary["haptic"][0])},
          {"device_sim 0", names(summary["device"][0])}};
}

class TraceFile : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  [[nodiscard]] std::string file() const { return folder_.path() + "/trace.json"; }
};

// As a viewer shows it: for each loop a row of steps that do not overlap, and in each step its stages without a gap.
TEST_P(TraceFile, HoldsEveryLoopsStepsAndTheirStages) {
  const Ended ended = run(scene("press"), {"--mode", GetParam(), "--duration", "0.5", "--trace", file()});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find(file()), std::string::npos) << "the output does not name the file";
  const Json trace = Json::parse(read_text(file()), nullptr, false);
  ASSERT_TRUE(trace.is_array());
  EXPECT_FALSE(std::filesystem::exists(out() + "/trace")) << "the programs' traces are not removed";

  std::map<int, std::string> programs;
  for (const Json& event : trace) {
    if (event["ph"] == "M" && event["name"] == "process_name") programs[event["pid"]] = event["args"]["name"];
  }
  const auto known = stages_of(summary());
  ASSERT_EQ(programs.size(), known.size());

  for (const auto& [pid, program] : programs) {
    SCOPED_TRACE(program);
    double newest_us = 0.0, step_end_us = 0.0, stage_end_us = 0.0;
    std::size_t steps = 0;
    std::set<std::string> stages, counters;
    for (const Json& event : trace) {
      if (event["pid"] != pid || event["ph"] == "M") continue;
      const std::string name = event["name"];
      const double at_us = event["ts"];
      ASSERT_GE(at_us, newest_us) << "event " << name << " goes back in time";
      newest_us = at_us;
      if (event["ph"] == "C") counters.insert(name);
      if (event["ph"] != "X") continue;
      const double end_us = at_us + event["dur"].get<double>();
      if (name == "step") {
        ASSERT_GE(at_us, step_end_us - kRounding_us) << "steps overlap";
        if (steps > 0) {
          ASSERT_NEAR(stage_end_us, step_end_us, kRounding_us) << "a step's end belongs to no stage";
        }
        step_end_us = end_us;
        stage_end_us = at_us;
        ++steps;
      } else {
        ASSERT_GT(steps, 0U);
        ASSERT_NEAR(at_us, stage_end_us, kRounding_us) << "a gap before " << name;
        ASSERT_LE(end_us, step_end_us + kRounding_us) << name << " ends after its step";
        stage_end_us = end_us;
        stages.insert(name);
      }
    }
    EXPECT_GE(steps, program == "world_sim" ? 100U : 400U);
    for (const std::string& stage : stages) EXPECT_TRUE(known.at(program).contains(stage)) << stage;
    for (const char* stage : {"wake", "decode", "send"}) EXPECT_TRUE(stages.contains(stage)) << stage;
    if (program == "haptic_sim 0") {
      EXPECT_EQ(counters, (std::set<std::string>{"force_n", "lateness_s", "members"}));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, TraceFile, ::testing::Values("lockstep", "realtime"),
                         [](const auto& one) { return one.param; });

class Tracing : public ProcessTest {};

TEST_F(Tracing, ToWhereNothingCanBeWrittenFailsBeforeAnythingRuns) {
  const std::string nowhere = folder_.path() + "/no/such/folder/trace.json";
  const Ended ended = run(scene("press"), {"--mode", "lockstep", "--duration", "0.1", "--trace", nowhere});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find(nowhere), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("--trace"), std::string::npos) << ended.err;
}

// The shares are of the work, without waiting.
TEST_F(Tracing, IsNotNeededForTheStagesInTheSummary) {
  const Ended ended = run(scene("press"), {"--mode", "lockstep", "--duration", "0.2"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  for (const Json& part : {json["world"], json["haptic"][0], json["device"][0]}) {
    double share = 0.0;
    for (const auto& [name, stage] : part["stages"].items()) {
      EXPECT_TRUE(name.ends_with("_s")) << name;
      EXPECT_LE(stage["p50"], stage["max"]) << name;
      EXPECT_EQ(stage.contains("share"), name != "wake_s") << name;
      share += stage.value("share", 0.0);
    }
    EXPECT_NEAR(share, 1.0, 1e-9);
  }
  EXPECT_GT(json["haptic"][0]["stages"]["advance_s"]["share"], 0.0);
  EXPECT_GT(json["world"]["stages"]["simulate_s"]["share"], 0.0);
}

}  // namespace
}  // namespace subworld::test
