// Attribution of a missed gate, by the measurements of a run.
#include "judge/gates.hpp"
#include "io/results/json.hpp"

#include "judge/summary.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace subworld {
namespace {

MachineShare share(double run_queue_delay_s) {
  MachineShare share;
  share.fifo = true;
  share.run_queue_delay_s = run_queue_delay_s;
  return share;
}

BareLoops bare_loops(std::uint64_t late, std::uint64_t wake_ups) {
  BareLoops loops;
  loops.late = late;
  loops.wake_ups = wake_ups;
  return loops;
}

/// A run of 10 s at 1 kHz on a quiet machine whose loops miss 20 steps and a cycle because the OS withheld time.
RunResults late_run(std::size_t users, bool placed, double queued_s) {
  RunResults run;
  run.scene.settings.mode = Mode::realtime;
  run.simulated_s = 10.0;
  run.cores = 2;
  run.load = CoreLoad{.own = 1.0};
  if (placed) run.placement.world = {1};
  run.world.cycles = 2500;
  run.world.late_by_os = 1;
  run.world.real_time_factor_min = 0.5;
  run.world.ratio.add(4.0);
  run.world.step_s = {.p50 = 0.002, .p99 = 0.003};
  run.world.machine = share(queued_s);
  run.world.contact_slack_j = 0.02;
  run.scene.users.resize(users);
  for (std::size_t u = 0; u < users; ++u) {
    HapticResult& haptic = run.haptic.emplace_back();
    haptic.user = u;
    haptic.steps = 10000;
    haptic.missed_by_os = 20;
    haptic.lateness_s.p99 = 0.0001;
    haptic.woken_late_s = {.p50 = 0.00001, .p99 = 0.0001};
    haptic.machine = share(queued_s);
    haptic.step_s = {.p50 = 0.0002, .p99 = 0.0005};
    haptic.proxy_apart_max_m = 0.02;
    haptic.device_work_j = 0.2;
    DeviceResult& device = run.device.emplace_back();
    device.user = u;
    device.operator_energy.net_j = 0.1;
    device.oscillation_n = 0.5;
  }
  return run;
}

Culprit culprit_of(const RunResults& run, const std::string& gate) {
  const auto all = gates(run);
  const auto found = std::ranges::find(all, gate, &Gate::name);
  EXPECT_NE(found, all.end()) << gate;
  EXPECT_FALSE(found->ok());
  return found->cause.culprit;
}

std::string verdict(const RunResults& run) { return verdict_of(gates(run), run); }

TEST(Verdict, StatesWhoWasAwayAndWhoWasStartedAgain) {
  RunResults run = late_run(2, true, 0.0);
  for (HapticResult& haptic : run.haptic) haptic.missed_by_os = 0;
  run.world.late_by_os = 0;
  run.world.real_time_factor_min = 1.0;
  run.restarts = {{"haptic_sim_1", 1.3, "killed by SIGKILL"}};
  run.world.absences = {{.user = 1, .from_s = 1.204, .to_s = 1.996},
                        {.user = 0, .from_s = 5.0, .to_s = 10.0, .by_order = true}};
  EXPECT_EQ(verdict(run),
            "ok; haptic_sim_1 was started again (killed by SIGKILL); user 1 absent from 1.20 to 2.00 s; user 0 left at "
            "5.00 s");
}

TEST(Gates, NamesADeviceThatMovedFasterThanAnOperatorCan) {
  RunResults run = late_run(1, true, 0.0);
  run.haptic[0].device_jumps = 801;
  const std::string text = verdict(run);
  EXPECT_NE(text.find("user 0: device faster than an operator moves 8.01 % of steps"), std::string::npos) << text;
}

constexpr const char* kMissed = "user 0: missed by the OS";
constexpr const char* kClock = "world real-time factor";

TEST(Gates, FramesThatTheNetworkLostAreARemark) {
  constexpr const char* kLost = "user 0: lost frames";
  RunResults run = late_run(1, true, 0.0);
  run.haptic[0].missed_by_os = 0;
  run.haptic[0].lost_frames = 3;
  run.world.real_time_factor_min = 1.0;
  run.scene.settings.h_s = 0.001;
  run.scene.settings.ratio = 4;
  EXPECT_EQ(culprit_of(run, kLost), Culprit::run) << "there is no network on one host";
  run.between_hosts = true;
  EXPECT_EQ(culprit_of(run, kLost), Culprit::network);
  EXPECT_EQ(verdict(run), "ok; user 0: lost frames 3, by the network");
  EXPECT_EQ(missed_strictly(gates(run)), std::vector<std::string>{kLost});
  run.haptic[0].skipped_steps = 32;
  EXPECT_EQ(culprit_of(run, kLost), Culprit::run) << "the sub-world was halted for eight cycles";
}

TEST(Gates, ReportsThatCameLateAreARemark) {
  constexpr const char* kLate = "user 0: late reports";
  RunResults run = late_run(1, true, 0.0);
  run.haptic[0].missed_by_os = 0;
  run.world.real_time_factor_min = 1.0;
  run.haptic[0].late_reports_ratio = 0.15;
  EXPECT_EQ(verdict(run), "ok") << "there is no network on one host";
  run.between_hosts = true;
  EXPECT_EQ(culprit_of(run, kLate), Culprit::network);
  EXPECT_EQ(verdict(run), "ok; user 0: late reports 15 % of reports, by the network");
}

TEST(Gates, ALoopThatWaitedForAnotherOneOfTheRunIsTheRunsFault) {
  EXPECT_EQ(culprit_of(late_run(2, true, 0.5), kMissed), Culprit::run);
  EXPECT_EQ(culprit_of(late_run(2, true, 0.001), kMissed), Culprit::os) << "it hardly waited";
  EXPECT_EQ(culprit_of(late_run(2, true, 0.11), kMissed), Culprit::os) << "10,000 typical wake-ups take 0.1 s";
  EXPECT_EQ(culprit_of(late_run(1, true, 0.5), kMissed), Culprit::os) << "there is no other";
  RunResults busy = late_run(2, true, 0.5);
  busy.load->other = 0.5;
  EXPECT_EQ(culprit_of(busy, kMissed), Culprit::os) << "others may have had the core";
}

TEST(Gates, AMachineThatWakesBareLoopsAsLateIsTheCause) {
  RunResults run = late_run(2, true, 0.5);
  run.calibration = bare_loops(1, 1000);
  EXPECT_EQ(culprit_of(run, kMissed), Culprit::run) << "a bare loop is late half as often";
  run.calibration->late = 9;
  EXPECT_EQ(culprit_of(run, kMissed), Culprit::os);
}

TEST(Gates, ALoopWithoutRealTimePriorityCompetesWithTheProgramsOfAFullRun) {
  RunResults run = late_run(1, true, 0.5);
  run.load->own = 1.9;
  EXPECT_EQ(culprit_of(run, kMissed), Culprit::os) << "nothing of the run pre-empts it";
  run.haptic[0].machine.fifo = false;
  EXPECT_EQ(culprit_of(run, kMissed), Culprit::run);
}

TEST(Gates, NameNoLoadOfAMachineThatWasNotMeasured) {
  for (const double queued_s : {0.5, 0.001}) {
    RunResults run = late_run(2, false, queued_s);
    run.load.reset();
    for (const Gate& gate : gates(run)) {
      EXPECT_EQ(gate.cause.why.find("of 2 cores"), std::string::npos) << gate.cause.why;
      for (const char* gap : {"()", "(;", "; )", "  "})
        EXPECT_EQ(gate.cause.why.find(gap), std::string::npos) << gate.cause.why;
    }
    EXPECT_TRUE(Json(run)["machine_load"].is_null());
  }
}

TEST(Gates, AWorldWithACoreOfItsOwnWaitsForNobody) {
  EXPECT_EQ(culprit_of(late_run(1, true, 0.5), kClock), Culprit::os);
  EXPECT_EQ(culprit_of(late_run(1, false, 0.5), kClock), Culprit::run);
  RunResults slow = late_run(1, true, 0.0);
  slow.world.late_by_run = 5;
  EXPECT_EQ(culprit_of(slow, kClock), Culprit::run);
}

// A cause must agree with the figures beside it.
TEST(Gates, ASlowClockIsNotBlamedOnShortSteps) {
  const auto why = [](const RunResults& run) {
    const auto all = gates(run);
    return std::ranges::find(all, kClock, &Gate::name)->cause.why;
  };
  RunResults run = late_run(1, true, 0.0);
  run.world.step_s = {.p50 = 0.0002, .p99 = 0.0004, .max = 0.03};
  run.world.late_by_os = 0;
  EXPECT_EQ(why(run), "") << "no cycle was late";
  EXPECT_EQ(verdict(run).find(": ;"), std::string::npos) << verdict(run);
  run.world.late_by_run = 1;
  EXPECT_NE(why(run).find("the longest 30.00 ms"), std::string::npos) << why(run);
  EXPECT_EQ(why(run).find("fewer bodies"), std::string::npos) << why(run);
  run.world.step_s.p99 = 0.005;
  EXPECT_NE(why(run).find("fewer bodies"), std::string::npos) << why(run);
  RunResults waited = late_run(1, false, 0.5);
  EXPECT_NE(why(waited).find("compete for the cores"), std::string::npos) << why(waited);
  waited.quota = {1.1, "/sys/fs/cgroup/cpu.max"};
  EXPECT_NE(why(waited).find("control group grants it 1.1 cores"), std::string::npos) << why(waited);
  waited.load->own = 0.5;
  EXPECT_NE(why(waited).find("of which /sys/fs/cgroup/cpu.max grants 1.1,"), std::string::npos) << why(waited);
}

/// A run that misses nothing.
RunResults quiet_run() {
  RunResults run = late_run(1, true, 0.0);
  run.haptic[0].missed_by_os = 0;
  run.world.real_time_factor_min = 1.0;
  return run;
}

// What the OS did is a remark: the verdict speaks of the run, and --strict of both.
TEST(Gates, AnOsThatIsLateIsARemark) {
  RunResults run = late_run(1, true, 0.0);
  run.calibration = bare_loops(9, 1000);
  run.haptic[0].missed_by_os = 12;
  run.haptic[0].skipped_steps = 34;
  const std::string remark =
      "ok; the OS delayed 12 of 10,034 steps past their deadline (0.12 %); bare loops on this machine: 9 of 1,000 "
      "wake-ups late";
  EXPECT_EQ(verdict(run), remark + "; world real-time factor 0.5, by the OS");
  EXPECT_EQ(missed_strictly(gates(run)), (std::vector<std::string>{"user 0: missed by the OS", kClock}));
  run.world.real_time_factor_min = 1.0;
  run.haptic[0].lateness_s.p99 = run.haptic[0].woken_late_s.p99 = 0.0003;
  EXPECT_EQ(verdict(run), remark + "; user 0: lateness p99 0.3 ms, by the OS");
}

TEST(Gates, StepsThatTakeTooLongAreNoRemark) {
  RunResults run = late_run(1, true, 0.0);
  run.haptic[0].missed_by_run = 30;
  EXPECT_TRUE(verdict(run).starts_with("quality gate missed: user 0: missed by the run 0.3 % of steps: steps take "))
      << verdict(run);
  run.scene.settings.delay.up_s = 0.1;
  run.haptic[0].round_trip_s.p50 = 0.1;
  EXPECT_NE(verdict(run).find("artificial delay 100 ms"), std::string::npos) << "also beside a miss: " << verdict(run);
  run.scene.settings.delay.up_s = run.haptic[0].round_trip_s.p50 = 0.0;
  run.haptic[0].missed_by_run = 10;
  EXPECT_TRUE(verdict(run).starts_with("ok; ")) << "within the gate: " << verdict(run);
  run.haptic[0].missed_by_os = 0;
  run.haptic[0].lateness_s.p99 = 0.0003;
  EXPECT_TRUE(verdict(run).starts_with("quality gate missed: user 0: lateness p99"))
      << "woken in time: " << verdict(run);
}

TEST(Gates, EnergyThatNoOperatorPutInIsUnstable) {
  RunResults run = quiet_run();
  ASSERT_EQ(verdict(run), "ok");
  run.device[0].operator_energy.created_j = 0.02;
  EXPECT_TRUE(verdict(run).starts_with("unstable: user 0: created energy at the operator 0.02 J")) << verdict(run);
  run.world.released_j = 0.03;
  EXPECT_EQ(verdict(run), "ok") << "bodies that fell may have brought it";
}

// What another operator put in is in the account of the port; the work of a whole run excuses nothing.
TEST(Gates, EnergyOfNobodyIsUnstableAlsoWhereAnotherOperatorWorks) {
  RunResults run = late_run(2, true, 0.0);
  for (HapticResult& haptic : run.haptic) haptic.missed_by_os = 0;
  run.device[0].operator_energy.net_j = 1.0;
  EXPECT_TRUE(verdict(run).starts_with("ok")) << verdict(run);
  run.device[1].operator_energy = {.net_j = -0.02, .least_j = -0.02, .created_j = 0.02};
  EXPECT_TRUE(verdict(run).starts_with("unstable: user 1: created energy at the operator 0.02 J")) << verdict(run);
  run.device[1].operator_energy.created_j = 0.0;
  run.world.operators_created_j = 0.02;
  EXPECT_TRUE(verdict(run).starts_with("unstable: created energy at all operators together 0.02 J")) << verdict(run);
}

TEST(Gates, EnergyThatTheBodiesGainedIsUnstable) {
  RunResults run = quiet_run();
  run.energy_excess_j = 0.08;
  EXPECT_TRUE(verdict(run).starts_with("unstable: energy that the bodies gained 0.08 J")) << verdict(run);
  EXPECT_NE(verdict(run).find("another --engine"), std::string::npos) << verdict(run);
  run.world.real_time_factor_min = 0.3;
  EXPECT_NE(verdict(run).find("the world was too slow, so its clock changed its rate"), std::string::npos)
      << verdict(run);
  run.world.real_time_factor_min = 1.0;
  run.world.released_j = 0.4;
  EXPECT_EQ(verdict(run), "ok") << "an engine may add a little energy to a falling body";
  run.world.released_j = 0.0;
  run.device[0].driver = DriverResult{.name = "udp", .version = {}, .refused_for = {}, .absences = 2};
  EXPECT_NE(verdict(run).find("a device was absent"), std::string::npos) << verdict(run);
  EXPECT_FALSE(verdict(run).starts_with("unstable")) << verdict(run);
}

TEST(Gates, EnergyBesideLateMessagesNamesTheLink) {
  RunResults run = late_run(1, false, 0.0);
  run.energy_excess_j = 0.08;
  run.between_hosts = true;
  run.link = "delay 30ms";
  EXPECT_EQ(verdict(run).find("link"), std::string::npos) << "messages came in time: " << verdict(run);
  run.haptic[0].late_reports_ratio = 0.2;
  EXPECT_NE(verdict(run).find("(link: delay 30ms)"), std::string::npos) << verdict(run);
  EXPECT_EQ(verdict(run).find("another --engine"), std::string::npos) << verdict(run);
}

TEST(Gates, AForceThatOscillatesIsUnstable) {
  RunResults run = quiet_run();
  run.device[0].oscillation_n = 2.5;
  EXPECT_TRUE(verdict(run).starts_with("unstable: user 0: oscillation of the force 2.5 N RMS")) << verdict(run);
  run = late_run(1, false, 0.0);
  run.device[0].oscillation_n = 2.5;
  run.haptic[0].missed_by_os = 4000;
  EXPECT_FALSE(verdict(run).starts_with("unstable")) << verdict(run);
}

TEST(Gates, AnAdmittanceDeviceThatItsProxyLeavesIsUnstable) {
  RunResults run = quiet_run();
  run.haptic[0].proxy_apart_max_m = 3.0;
  EXPECT_EQ(verdict(run), "ok") << "the spring of an impedance device holds it, up to its limit";
  run.scene.users[0].device.kind = DeviceKind::admittance;
  EXPECT_TRUE(verdict(run).starts_with("unstable: user 0: distance between proxy and device 3 m")) << verdict(run);
  run.scene.settings.delay.to_device_s = 5.0;
  EXPECT_EQ(verdict(run), "ok") << "a late device is behind";
}

TEST(Gates, TheLimitsOfAShortRunAreReported) {
  RunResults run = quiet_run();
  run.simulated_s = 1.0;
  bool said = false;
  for (const Gate& gate : gates(run)) said = said || gate.name.find("too short to detect") != std::string::npos;
  EXPECT_TRUE(said);
}

// The worst reading stands for its gate, and none is lost.
TEST(Gates, NameAllReadingsThatAreMissed) {
  RunResults run = late_run(2, true, 0.0);
  run.between_hosts = true;
  for (HapticResult& haptic : run.haptic) haptic.missed_by_os = 0;
  run.world.real_time_factor_min = 1.0;
  const std::size_t count = gates(run).size();
  run.haptic[0].late_reports_ratio = 0.15;
  run.haptic[1].lost_frames = 3;
  run.haptic[1].skipped_steps = 1000;
  run.device[1].refused.device_command = 2;
  run.world.refused.scene = 1;
  EXPECT_EQ(gates(run).size(), count);
  const auto line = [&](const std::string& name) {
    const auto all = gates(run);
    const auto found = std::ranges::find(all, name, &Gate::name);
    return found == all.end() ? "no gate " + name : found->line();
  };
  const std::string messages = line("user 1: lost frames"), writers = line("scene from a foreign writer");
  EXPECT_TRUE(messages.starts_with("user 1: lost frames 3 <= 0: MISSED: ")) << messages;
  EXPECT_TRUE(messages.ends_with("; also user 0: late reports 15 % of reports")) << messages;
  EXPECT_TRUE(writers.ends_with("; also user 1: device_command from a foreign writer 2")) << writers;
}

TEST(Gates, AGoodVerdictReportsTheDevicesLimit) {
  RunResults run = quiet_run();
  run.haptic[0].at_limit_ratio = 0.83;
  EXPECT_EQ(verdict(run), "ok; user 0: at the device's limit 83 % of steps");
}

TEST(Gates, AForeignWriterIsNamed) {
  RunResults run = quiet_run();
  run.device[0].refused.device_command = 12;
  EXPECT_TRUE(verdict(run).starts_with("quality gate missed: user 0: device_command from a foreign writer 12"))
      << verdict(run);
  EXPECT_NE(verdict(run).find("haptic_sim"), std::string::npos);
  run.device[0].oscillation_n = 2.5;
  EXPECT_TRUE(verdict(run).starts_with("unstable: ")) << verdict(run);
  EXPECT_NE(verdict(run).find("; also user 0: device_command from a foreign writer 12"), std::string::npos)
      << verdict(run);
}

}  // namespace
}  // namespace subworld
