#include "rt/scheduling.hpp"
#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <sched.h>

#include <cstdlib>
#include <filesystem>
#include <thread>

namespace subworld {
namespace {

int threads_of(int policy) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task"))
    count += sched_getscheduler(std::atoi(entry.path().filename().c_str())) == policy;
  return count;
}

// Fast DDS repeats samples in a thread that spins for the lock of a writer. With real-time priority, it would stop a
// program on one core where the thread that has the lock was interrupted: 1 of about 50 starts of a run.
TEST(WireOneCore, the_one_that_spins_for_locks_is_never_raised) {
  const test::TestDomain domain;
  std::thread([&] {
    if (!claim_realtime(priority::kMiddleware).fifo) GTEST_SKIP() << "real-time priorities are not permitted here";
    leave_realtime();
    const std::set<pid_t> before = own_threads();
    const auto bus = open_bus(test::config_of(Vendor::fastdds, domain.number(), Mode::realtime));
    const auto writer = bus->writer<Status>();
    const auto reader = bus->reader<Status>();
    EXPECT_EQ(threads_of(SCHED_FIFO), 0);
    raise_threads_since(before, priority::kMiddleware);
    EXPECT_GE(threads_of(SCHED_BATCH), 1);
    EXPECT_GE(threads_of(SCHED_FIFO), 3) << "those that receive and that keep time";
  }).join();
}

}  // namespace
}  // namespace subworld
