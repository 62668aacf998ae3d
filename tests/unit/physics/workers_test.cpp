#include "physics/workers.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace subworld {
namespace {

class WorkersTest : public testing::TestWithParam<int> {
 protected:
  Workers workers{GetParam()};
};

TEST_P(WorkersTest, EachIsDoneOnce) {
  for (const std::size_t count : {0, 1, 15, 16, 17, 1000}) {
    for (int repeat = 0; repeat < 200; ++repeat) {
      std::vector<int> done(count);
      workers.run(count, 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++done[i];
      });
      ASSERT_EQ(done, std::vector<int>(count, 1));
    }
  }
}

// What one loop has written the next one reads, on whatever thread.
TEST_P(WorkersTest, ALoopSeesTheLoopBefore) {
  std::vector<int> values(1000), next(1000);
  for (int repeat = 1; repeat <= 500; ++repeat) {
    workers.run(values.size(), 10, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) next[i] = values[values.size() - 1 - i] + 1;
    });
    values.swap(next);
  }
  EXPECT_EQ(values, std::vector<int>(1000, 500));
}

TEST_P(WorkersTest, WorkAfterARestIsDone) {
  for (int repeat = 0; repeat < 5; ++repeat) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));  // they fall asleep
    std::atomic<int> done = 0;
    workers.run(100, 1, [&](std::size_t begin, std::size_t end) { done += static_cast<int>(end - begin); });
    EXPECT_EQ(done, 100);
  }
}

INSTANTIATE_TEST_SUITE_P(Threads, WorkersTest, testing::Values(1, 2, 3, 8));

}  // namespace
}  // namespace subworld
