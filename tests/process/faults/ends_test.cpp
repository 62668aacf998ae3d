// The ends of programs that are started by hand, and what a killed one leaves.
#include "process/faults/ends.hpp"

#include <tuple>

namespace subworld::test {
namespace {

class Waiting : public ByHandEnds, public ::testing::WithParamInterface<std::tuple<std::string, int>> {};

TEST_P(Waiting, ASignalEndsEveryProgram) {
  const auto& [dds, signal] = GetParam();
  common_ = {"--dds", dds};
  for (const char* name : {"haptic_sim", "device_sim", "gui_headless"}) start(name);
  const TestDomain other;
  start("world_sim", {"--domain", other.text(), "--await-display"});
  for (const Started& one : started_) {
    ASSERT_TRUE(eventually([&] { return one.process->out().find("dds=") != std::string::npos; })) << one.name;
  }
  for (const Started& one : started_) one.process->signal(signal);
  for (const Started& one : started_) EXPECT_EQ(one.process->wait(), 0) << one.name << one.process->err();
}

const auto kWaits = halves<std::string, int>({"fastdds", "cyclonedds"}, {SIGINT, SIGTERM});
std::string name_of_wait(const ::testing::TestParamInfo<std::tuple<std::string, int>>& one) {
  return std::get<0>(one.param) + (std::get<1>(one.param) == SIGINT ? "_INT" : "_TERM");
}
INSTANTIATE_TEST_SUITE_P(Vendors, Waiting, ::testing::ValuesIn(kWaits.half), name_of_wait);
INSTANTIATE_TEST_SUITE_P(Full, Waiting, ::testing::ValuesIn(kWaits.other), name_of_wait);

TEST_F(ByHandEnds, ASignalEndsAProgramThatLoads) {
  Process& world = start("world_sim", {"--engine", "slow"}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  world.signal(SIGTERM);
  EXPECT_EQ(world.wait(), 0) << world.err();
  EXPECT_EQ(world.out().find("settling"), std::string::npos) << "it had loaded already";
}

// A busy program may take any time, for example to make an engine.
TEST_F(ByHandEnds, ASignalEndsAProgramThatIsBusy) {
  common_ = {"--mode", "realtime", "--duration", "1000"};
  Process& world = start("world_sim", {}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  start("haptic_sim");
  start("device_sim");
  ASSERT_TRUE(eventually([&] { return world.out().find("running") != std::string::npos; })) << world.err();
  const Ended order =
      finish({program("subworld"), "control", "engine", "slow", "--domain", domain_.text(), "--wait", "2"});
  ASSERT_NE(order.err.find("preparing"), std::string::npos) << order.err;
  world.signal(SIGTERM);
  EXPECT_TRUE(world.wait());
}

class Halted : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

// Its reports do not arrive, but its death is not yet certain.
TEST_P(Halted, ASignalEndsALockstepWorldThatWaitsForAHapticProcess) {
  start_run("lockstep", GetParam());
  if (HasFatalFailure()) return;
  haptic_->signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  world_->signal(SIGTERM);
  EXPECT_EQ(world_->wait(), 0) << world_->err();
}

INSTANTIATE_TEST_SUITE_P(Vendors, Halted, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

class LostByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(LostByHand, IsNamedByItsPeers) {
  const Loss& loss = GetParam();
  start_run(loss.mode, loss.dds, {"--wait", "1"});
  if (HasFatalFailure()) return;
  Process* const victim = loss.victim == "world_sim" ? world_ : loss.victim == "haptic_sim" ? haptic_ : device_;
  victim->signal(SIGKILL);
  std::string said;
  for (Process* one : {world_, haptic_, device_}) {
    if (one == victim) continue;
    const auto code = one->wait();
    said += one->err();
    EXPECT_EQ(code, 1) << one->err();
  }
  const std::string label = loss.victim == "world_sim" ? loss.victim : loss.victim + " 0";
  EXPECT_NE(said.find("error: " + label + " has died"), std::string::npos) << said;
}

INSTANTIATE_TEST_SUITE_P(Lockstep, LostByHand, ::testing::ValuesIn(losses("lockstep").half), name_of);
INSTANTIATE_TEST_SUITE_P(Realtime, LostByHand, ::testing::ValuesIn(losses("realtime").other), name_of);
INSTANTIATE_TEST_SUITE_P(Full, LostByHand, ::testing::ValuesIn(losses("lockstep").other), name_of);
INSTANTIATE_TEST_SUITE_P(FullRealtime, LostByHand, ::testing::ValuesIn(losses("realtime").half), name_of);

class StoppedByHand : public ByHandEnds, public ::testing::WithParamInterface<Loss> {};

TEST_P(StoppedByHand, EndsTheRunWithAMessageThatSaysSo) {
  const Loss& loss = GetParam();
  start_run(loss.mode, loss.dds);
  if (HasFatalFailure()) return;
  Process* const victim = loss.victim == "haptic_sim" ? haptic_ : device_;
  victim->signal(SIGTERM);
  EXPECT_EQ(victim->wait(), 0) << victim->err();
  for (Process* one : {world_, haptic_, device_}) {
    if (one == victim) continue;
    EXPECT_EQ(one->wait(), 1) << one->err();
    EXPECT_NE(one->err().find(loss.victim + " 0 was stopped before the end of the run"), std::string::npos)
        << one->err();
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, StoppedByHand,
                         ::testing::Values(Loss{"lockstep", "fastdds", "haptic_sim"},
                                           Loss{"lockstep", "cyclonedds", "device_sim"}),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Full, StoppedByHand,
                         ::testing::Values(Loss{"lockstep", "fastdds", "device_sim"},
                                           Loss{"lockstep", "cyclonedds", "haptic_sim"}),
                         name_of);

class OtherScene : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(OtherScene, OfADeviceIsRefusedAndTheOthersLearnWhy) {
  common_ = {"--mode", GetParam(), "--duration", "1000"};
  Process& world = start("world_sim");
  Process& haptic = start("haptic_sim");
  Process& device = start("device_sim", {"--ratio", "10"});
  EXPECT_EQ(device.wait(), 2) << device.err();
  const std::string why = "with other settings: settings.ratio is 10, in the world 4. Give all programs";
  EXPECT_NE(device.err().find(why), std::string::npos) << device.err();
  for (Process* const other : {&world, &haptic}) {
    const auto knows = [&] {
      const std::string said = other->err();
      const std::size_t at = said.find("device_sim 0 has ended: ");
      return at != std::string::npos && said.find(why, at) != std::string::npos;
    };
    EXPECT_TRUE(eventually(knows)) << other->err();
  }
  for (const Started& one : started_) one.process->signal(SIGTERM);
  for (const Started& one : started_) EXPECT_TRUE(one.process->wait()) << one.name;
}

INSTANTIATE_TEST_SUITE_P(Modes, OtherScene, ::testing::Values("lockstep"), [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, OtherScene, ::testing::Values("realtime"),
                         [](const auto& one) { return one.param; });

TEST_F(ByHandEnds, AProgramThatIsRefusedLeavesTheHistoryOfTheKilledOne) {
  start_run("lockstep", "fastdds", {"--wait", "3"});
  if (HasFatalFailure()) return;
  haptic_->signal(SIGKILL);
  ASSERT_EQ(haptic_->wait(), 128 + SIGKILL);
  const std::size_t before = read_table(out() + "/haptic_0.csv").rows.size();
  Process& again = start("haptic_sim", {"--out", out()});
  EXPECT_EQ(again.wait(), 1) << again.out();
  EXPECT_EQ(read_table(out() + "/haptic_0.csv").rows.size(), before);
  for (Process* one : {world_, device_}) EXPECT_TRUE(one->wait());
}

TEST_F(RunEnds, AHistoryHoldsWhatAKilledProgramHasDone) {
  start("realtime", "fastdds", "1000");
  if (HasFatalFailure()) return;
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  const std::size_t at_least = 300;  // of the 700 and more steps that were made
  signal("haptic_sim", SIGKILL);
  EXPECT_EQ(process_->wait(), 1);
  const Table table = read_table(out() + "/haptic_0.csv");
  EXPECT_GT(table.rows.size(), at_least);
  const Json part = summary()["haptic"][0];
  EXPECT_EQ(part["steps"].get<std::size_t>(), table.rows.size());
  EXPECT_NEAR(part["to_s"], table.rows.back()[table.column("time_s")], 1e-9);
  EXPECT_TRUE(part.contains("force_max_n"));
  EXPECT_GT(read_table(out() + "/device_0.csv").rows.size(), at_least);
}

}  // namespace
}  // namespace subworld::test
