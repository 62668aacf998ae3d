#include "process/process_test.hpp"
#include "support/grid.hpp"

#include <unistd.h>

#include <cmath>

namespace subworld::test {
namespace {

class Summary : public ProcessTest {};

// A device of 2 N cannot show a press of 12 N: the figures are those of the device, and the run says so.
TEST_F(Summary, TellsTheOperatorsForceAndHowOftenTheDeviceWasAtItsLimit) {
  constexpr double kLimit_n = 2.0;
  const Ended ended =
      run(edited("press", "force_limit_n: 40", "force_limit_n: 2"), {"--mode", "lockstep", "--duration", "1"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json haptic = summary()["haptic"][0];
  const Table table = read_table(out() + "/haptic_0.csv");
  const std::size_t x = table.column("operator_force_x_n");
  double squares = 0.0, most = 0.0, largest_step = 0.0;
  int at_limit = 0;
  std::vector<double> before(table.columns.size(), 0.0);
  for (const auto& row : table.rows) {
    const double force = std::hypot(row[x], row[x + 1], row[x + 2]);
    squares += force * force;
    most = std::max(most, force);
    at_limit += force > kLimit_n * (1.0 - 1e-6);
    largest_step =
        std::max(largest_step, std::hypot(row[x] - before[x], row[x + 1] - before[x + 1], row[x + 2] - before[x + 2]));
    before = row;
  }
  const auto steps = static_cast<double>(table.rows.size());
  ASSERT_GT(at_limit, 0);
  EXPECT_NEAR(most, kLimit_n, 1e-6);
  EXPECT_NEAR(haptic["force_max_n"], most, 1e-6);
  EXPECT_NEAR(haptic["force_rms_n"], std::sqrt(squares / steps), 1e-6);
  EXPECT_NEAR(haptic["force_step_max_n"], largest_step, 1e-6);
  EXPECT_NEAR(haptic["at_limit_ratio"], at_limit / steps, 1e-9);
  // The force on the operator is ramped, the coupling's is not.
  EXPECT_GE(haptic["coupling_force_rms_n"], haptic["force_rms_n"]);
  EXPECT_NE(ended.out.find("the operator feels the limit, not the scene"), std::string::npos) << ended.out;
  EXPECT_TRUE(summary()["verdict"].get<std::string>().starts_with("ok; user 0: at the device's limit"))
      << "a warning is no missed gate: " << summary()["verdict"];
}

void expect_record_keys(const Json& json, const Words& keys, const std::string& what) {
  for (const std::string& key : keys) EXPECT_TRUE(json.contains(key)) << what << " has no " << key;
}

/// Every missed deadline is attributed; bare loops and the kernel's record of each loop are measured.
void expect_attributed(const Ended& ended, const Json& json) {
  EXPECT_GE(json["calibration"]["wake_ups"], 1);
  EXPECT_LE(json["calibration"]["late"], json["calibration"]["wake_ups"]);
  const Json& haptic = json["haptic"][0];
  EXPECT_EQ(haptic["missed_deadlines"].get<int>(),
            haptic["missed_by_run"].get<int>() + haptic["missed_by_os"].get<int>());
  EXPECT_EQ(json["world"]["late_cycles"].get<int>(),
            json["world"]["late_by_run"].get<int>() + json["world"]["late_by_os"].get<int>());
  for (const Json* loop : {&json["world"], &haptic, &json["device"][0]}) {
    expect_record_keys(
        (*loop)["machine"],
        {"scheduling", "cpu_s", "run_queue_delay_s", "involuntary_switches", "voluntary_switches", "stolen_s"},
        "machine");
    EXPECT_GT((*loop)["machine"]["voluntary_switches"], 10) << "a loop sleeps between its steps";
  }
  EXPECT_NE(ended.out.find("how late this machine wakes a loop without work"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find(" by the OS)"), std::string::npos) << ended.out;
}

// The summary is sufficient to repeat the run, and contains the limits of its gates.
TEST_F(Summary, IsACompleteRecord) {
  const Words flags{"--mode", "realtime", "--duration", "1", "--dds", "mixed"};
  const Ended ended = run(scene("press"), flags);
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  expect_attributed(ended, json);
  expect_record_keys(json,
                     {"command_line", "date", "version", "machine", "machine_load", "settings", "gates", "calibration"},
                     "summary");
  const auto command = json["command_line"].get<std::string>();
  EXPECT_NE(command.find("run " + scene("press")), std::string::npos) << command;
  EXPECT_NE(command.find("--mode realtime --duration 1 --dds mixed"), std::string::npos) << command;
  const auto date = json["date"].get<std::string>();  // 2026-01-31T12:00:00+01:00
  ASSERT_EQ(date.size(), 25U) << date;
  EXPECT_EQ(date[10], 'T') << date;
  EXPECT_EQ(date[22], ':') << date;

  ASSERT_FALSE(json["gates"].empty());
  for (const Json& gate : json["gates"]) {
    expect_record_keys(gate, {"name", "value", "bound", "at_most", "unit", "ok"}, "gate");
    EXPECT_EQ(gate["ok"].get<bool>(),
              gate["at_most"].get<bool>() ? gate["value"] <= gate["bound"] : gate["value"] >= gate["bound"]);
    if (gate["ok"].get<bool>()) continue;
    expect_record_keys(gate, {"missed_by", "why"}, "missed gate");
    EXPECT_FALSE(gate["why"].get<std::string>().empty()) << gate;
  }

  const Json& settings = json["settings"];
  expect_record_keys(
      settings, {"world_engine", "haptic_engine", "settle_s", "settle_step_s", "paper", "delay", "users"}, "settings");
  for (const char* engine : {"world_engine", "haptic_engine"}) {
    expect_record_keys(settings[engine], {"name", "version", "preset", "preset_means", "length_unit_m", "gravity_m_s2"},
                       engine);
    EXPECT_EQ(settings[engine]["iterations"], 50);
  }
  const Json& user = settings["users"][0];
  EXPECT_EQ(user["coupling"]["stiffness_n_m"], 1000.0);
  EXPECT_EQ(user["device"]["force_limit_n"], 40.0);
  EXPECT_EQ(user["selection"]["box_half_m"], 0.2);
  EXPECT_NE(json["world"]["dds"].get<std::string>().find("fastdds"), std::string::npos) << json["world"];
  EXPECT_NE(json["haptic"][0]["dds"].get<std::string>().find("cyclonedds"), std::string::npos);
  EXPECT_NE(json["device"][0]["dds"].get<std::string>().find("fastdds"), std::string::npos);
  EXPECT_GE(json["world"]["substeps"], 1);
  EXPECT_GT(json["world"]["integration_substep_s"], 0.0);
  EXPECT_NEAR(settings["haptic_engine"]["integration_substep_s"].get<double>(), 0.001, 1e-9);
}

// Steps that take longer than their period: the run reports that the OS is not the cause, and the cure.
TEST_F(Summary, BlamesTheStepsWhereTheyTakeTooLong) {
  const Ended ended =
      run(scene("press"),
          {"--mode", "realtime", "--duration", "2", "--haptic-engine", "busy", "--set", "haptic.preset=always"},
          {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  EXPECT_GT(json["haptic"][0]["step_s"]["p50"], json["h_s"]);
  EXPECT_NE(ended.out.find(": MISSED: steps take "), std::string::npos) << ended.out;
  // With so few steps the force may also oscillate, which a verdict names first.
  const auto verdict = json["verdict"].get<std::string>();
  EXPECT_TRUE(verdict.starts_with("unstable: ") || verdict.starts_with("quality gate missed: ")) << verdict;
  EXPECT_GT(json["haptic"][0]["missed_by_run"], json["haptic"][0]["missed_by_os"]) << ended.out;
  EXPECT_NE(ended.out.find("cannot keep up: a step takes"), std::string::npos) << ended.out;
}

// A run without real-time rights reports it on the terminal, with the cure.
TEST_F(Summary, SaysOnTheTerminalThatThereAreNoRealTimeRights) {
  // Root has the rights by capabilities, other users by a limit.
  const std::string drop =
      std::string("ulimit -r 0; exec ") + (geteuid() == 0 ? "setpriv --bounding-set -all --inh-caps -all " : "");
  Words words{"/bin/bash", "-c", drop + "\"$@\"", "sh"};
  const Words command = run_words(scene("press"), {"--mode", "realtime", "--duration", "0.5"});
  words.insert(words.end(), command.begin(), command.end());
  const Ended ended = finish(words);
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("real-time rights"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("limits.conf"), std::string::npos) << ended.out;
}

// Loading takes longer than a program waits for a missing world.
TEST_F(Summary, AWorldThatIsBeingCreatedIsWaitedForVisibly) {
  const Ended ended =
      run(scene("press"), {"--mode", "lockstep", "--duration", "0.2", "--engine", "slow", "--wait", "2"},
          {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("creating 4 bodies"), std::string::npos) << ended.out;
}

class Shown : public Summary, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

// Time, rate, force, and in real time misses and the real-time factor, while it runs and not only at its end.
TEST_P(Shown, OnATerminalARunShowsHowItGoes) {
  const auto& [mode, dds] = GetParam();
  Process process(run_words(scene("press"), {"--mode", mode, "--duration", "1000", "--dds", dds}), folder_.path(), {},
                  Process::Output::terminal);
  const auto shows = [&](const std::string& text) {
    return eventually([&] { return process.read_terminal().find(text) != std::string::npos; });
  };
  EXPECT_TRUE(shows("t = ")) << process.read_terminal();
  EXPECT_TRUE(shows(" of 1000 s; ")) << process.read_terminal();
  EXPECT_TRUE(shows(" Hz; force ")) << process.read_terminal();
  if (mode == "realtime") {
    EXPECT_TRUE(shows("; missed ")) << process.read_terminal();
    EXPECT_TRUE(shows("; real-time factor ")) << process.read_terminal();
  }
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(), 0);
  const std::string& all = process.read_terminal();
  EXPECT_EQ(all.find("deadline missed"), std::string::npos) << all;
  EXPECT_EQ(all.find("matched"), std::string::npos) << all;
}

INSTANTIATE_TEST_SUITE_P(Ways, Shown,
                         ::testing::ValuesIn(halves<std::string, std::string>({"lockstep", "realtime"},
                                                                              {"fastdds", "cyclonedds", "mixed"})
                                                 .half),
                         [](const auto& one) { return std::get<0>(one.param) + "_" + std::get<1>(one.param); });

// Programs that start and end are reported neither on the terminal nor in a log.
TEST_F(Summary, ComingAndGoingIsWorthNoLine) {
  for (const char* dds : {"fastdds", "cyclonedds"}) {
    const Ended ended = run(scene("press"), {"--mode", "lockstep", "--duration", "0.3", "--dds", dds});
    ASSERT_EQ(ended.code, 0) << ended.err;
    for (const auto& log : std::filesystem::directory_iterator(out() + "/logs")) {
      const std::string text = read_text(log.path());
      for (const char* noise : {"matched", "deadline missed", "no sign of life", "for two periods"}) {
        EXPECT_EQ(text.find(noise), std::string::npos) << log.path() << ": " << text;
      }
    }
  }
}

}  // namespace
}  // namespace subworld::test
