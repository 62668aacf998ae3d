#include "process/process_test.hpp"

#include "rt/scheduling.hpp"

#include <sched.h>

#include <filesystem>
#include <map>

namespace subworld::test {
namespace {

/// Number of a process's threads under SCHED_FIFO, by priority.
std::map<int, int> realtime_threads(pid_t pid) {
  std::map<int, int> count;
  std::error_code gone;
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task", gone)) {
    const auto thread = static_cast<pid_t>(std::stol(task.path().filename().string()));
    sched_param parameter{};
    if (sched_getscheduler(thread) == SCHED_FIFO && sched_getparam(thread, &parameter) == 0)
      ++count[parameter.sched_priority];
  }
  return count;
}

class Middleware : public ProcessTest, public ::testing::WithParamInterface<std::string> {};

// If a thread that receives for the haptic loop waits for the world, the operator's force is late.
TEST_P(Middleware, ThreadsOutrankTheWorldInEveryProgram) {
  Process run(run_words(scene("press"), {"--mode", "realtime", "--duration", "600", "--dds", GetParam()}),
              folder_.path());
  const std::string log = out() + "/logs/world_sim.log";
  ASSERT_TRUE(eventually([&] { return read_text(log).find("running at") != std::string::npos; })) << run.err();
  const bool granted = read_text(log).find("SCHED_FIFO") != std::string::npos;
  std::map<std::string, int> loops{
      {"world_sim", priority::kWorld}, {"haptic_sim", priority::kHaptic}, {"device_sim", priority::kDevice}};
  int seen = 0;
  for (const Running& one : running(folder_.path())) {
    const auto loop = loops.find(std::filesystem::path(one.words.front()).filename().string());
    if (loop == loops.end()) continue;
    SCOPED_TRACE(loop->first);
    ++seen;
    if (!granted) {
      EXPECT_TRUE(realtime_threads(one.pid).empty()) << "the log says that there are no rights";
      continue;
    }
    const int of_loop = loop->second;
    ASSERT_TRUE(eventually([&] { return realtime_threads(one.pid)[of_loop] == 1; })) << "the loop itself";
    auto threads = realtime_threads(one.pid);
    EXPECT_GE(threads[priority::kMiddleware], 3) << "threads for receiving, retransmission and leases";
    threads.erase(priority::kMiddleware);
    threads.erase(of_loop);
    EXPECT_TRUE(threads.empty()) << "a thread at priority " << threads.begin()->first;
  }
  EXPECT_EQ(seen, 3);
  run.signal(SIGINT);
  EXPECT_EQ(run.wait(), 0) << run.err();
}

class Placement : public ProcessTest {};

TEST_F(Placement, OnACoreThatIsNotThereIsRefused) {
  const Ended ended = finish({program("device_sim"), scene("press")}, {{"SUBWORLD_DEVICE_SIM_CORE", "1023"}});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("1023"), std::string::npos) << ended.err;
}

// Haptic loops on the world's core would pre-empt it in each of their periods.
TEST_F(Placement, TheWorldHasACoreOfItsOwn) {
  const std::vector<int> cores = allowed_cores();
  const bool has_room = cores.size() > 1;
  // In its own temporary folder, so that the run does not depend on other runs on this machine.
  Process run(run_words(scene("press"), {"--mode", "realtime", "--duration", "600"}), folder_.path(),
              {{"TMPDIR", folder_.path()}, {"SUBWORLD_PLACEMENT", "auto"}});
  const std::string log = out() + "/logs/world_sim.log";
  ASSERT_TRUE(eventually([&] { return read_text(log).find("running at") != std::string::npos; })) << run.err();
  int seen = 0;
  for (const Running& one : running(folder_.path())) {
    const std::string name = std::filesystem::path(one.words.front()).filename().string();
    if (name.find("_sim") == std::string::npos) continue;
    SCOPED_TRACE(name);
    ++seen;
    cpu_set_t allowed;
    ASSERT_EQ(sched_getaffinity(one.pid, sizeof allowed, &allowed), 0);
    const bool is_world = name == "world_sim";
    EXPECT_EQ(CPU_ISSET(cores.back(), &allowed) != 0, is_world || !has_room);
    EXPECT_EQ(static_cast<std::size_t>(CPU_COUNT(&allowed)), is_world || !has_room ? 1 : cores.size() - 1);
  }
  EXPECT_EQ(seen, 3);
  run.signal(SIGINT);
  EXPECT_EQ(run.wait(), 0) << run.err();
}

INSTANTIATE_TEST_SUITE_P(Vendors, Middleware, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
