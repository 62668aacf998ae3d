// How programs and runs end: what each of them says, its exit code, and that it takes no longer than two seconds.
#include "process/process_test.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <tuple>

namespace subworld::test {
namespace {

constexpr double kEndBound_s = 3.0;  // two seconds and slack for a busy machine

using Instant = std::chrono::steady_clock::time_point;

Instant now() { return std::chrono::steady_clock::now(); }
double seconds_since(Instant begin) { return std::chrono::duration<double>(now() - begin).count(); }

/// One program with a folder of its own for what it prints.
struct Started {
  std::string name;
  std::unique_ptr<Process> process;
};

/// The programs of a run of scene `press`, each started by hand.
class ByHandEnds : public ProcessTest {
 protected:
  void TearDown() override {
    started_.clear();
    ProcessTest::TearDown();
  }

  Process& start(const std::string& name, const Words& flags = {}, const Environment& environment = {}) {
    const std::string folder = folder_.path() + "/" + std::to_string(started_.size()) + "_" + name;
    std::filesystem::create_directories(folder);
    Words words{program(name), scene("press"), "--domain", domain_.text()};
    words.insert(words.end(), common_.begin(), common_.end());
    words.insert(words.end(), flags.begin(), flags.end());
    started_.push_back({name, std::make_unique<Process>(words, folder, environment)});
    return *started_.back().process;
  }
  /// World, haptic process and device, in the middle of their loops.
  void start_run(const std::string& mode, const std::string& dds, const Words& flags = {}) {
    common_ = {"--mode", mode, "--dds", dds, "--duration", "1000"};
    common_.insert(common_.end(), flags.begin(), flags.end());
    world_ = &start("world_sim");
    haptic_ = &start("haptic_sim", {"--out", out()});
    device_ = &start("device_sim");
    ASSERT_TRUE(eventually([&] {
      return mode == "realtime" ? haptic_->out().find(" Hz") != std::string::npos
                                : read_text(out() + "/haptic_0.csv").size() > 10000;
    })) << haptic_->err();
    if (mode == "realtime") std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }

  Words common_;
  std::vector<Started> started_;
  Process* world_ = nullptr;
  Process* haptic_ = nullptr;
  Process* device_ = nullptr;
};

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
  const Instant begin = now();
  for (const Started& one : started_) one.process->signal(signal);
  for (const Started& one : started_) EXPECT_EQ(one.process->wait(10.0), 0) << one.name << one.process->err();
  EXPECT_LT(seconds_since(begin), kEndBound_s);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Waiting,
                         ::testing::Combine(::testing::Values("fastdds", "cyclonedds"),
                                            ::testing::Values(SIGINT, SIGTERM)),
                         [](const auto& one) {
                           return std::get<0>(one.param) + (std::get<1>(one.param) == SIGINT ? "_INT" : "_TERM");
                         });

TEST_F(ByHandEnds, ASignalEndsAProgramThatLoads) {
  Process& world = start("world_sim", {"--engine", "slow"}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const Instant begin = now();
  world.signal(SIGTERM);
  EXPECT_EQ(world.wait(10.0), 0) << world.err();
  EXPECT_LT(seconds_since(begin), kEndBound_s);
  EXPECT_EQ(world.out().find("settling"), std::string::npos) << "it had loaded already";
}

// What a program is busy with may take as long as it likes: an engine that is still being made, say.
TEST_F(ByHandEnds, ASignalEndsAProgramThatIsBusy) {
  common_ = {"--mode", "realtime", "--duration", "1000"};
  Process& world = start("world_sim", {}, {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  start("haptic_sim");
  start("device_sim");
  ASSERT_TRUE(eventually([&] { return world.out().find("running") != std::string::npos; })) << world.err();
  const Ended order =
      finish({program("subworld"), "control", "engine", "slow", "--domain", domain_.text(), "--wait", "2"});
  ASSERT_NE(order.err.find("preparing"), std::string::npos) << order.err;
  const Instant begin = now();
  world.signal(SIGTERM);
  EXPECT_TRUE(world.wait(10.0));
  EXPECT_LT(seconds_since(begin), kEndBound_s);
}

class Halted : public ByHandEnds, public ::testing::WithParamInterface<std::string> {};

// Its reports do not come, but nobody can say yet that it has died.
TEST_P(Halted, ASignalEndsALockstepWorldThatWaitsForAHapticProcess) {
  start_run("lockstep", GetParam());
  if (HasFatalFailure()) return;
  haptic_->signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const Instant begin = now();
  world_->signal(SIGTERM);
  EXPECT_EQ(world_->wait(10.0), 0) << world_->err();
  EXPECT_LT(seconds_since(begin), kEndBound_s);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Halted, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
