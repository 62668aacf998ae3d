#include "ros2/rate_limit.hpp"

#include <gtest/gtest.h>

namespace subworld::ros2 {
namespace {

using namespace std::chrono_literals;

/// Of a message every millisecond for a second, in bursts of so many.
int passed(double rate_hz, int burst) {
  RateLimit limit(rate_hz);
  int count = 0;
  for (int i = 0; i < 1000; ++i) count += limit.passes(RateLimit::Clock::time_point(1h + (i / burst * burst) * 1ms));
  return count;
}

TEST(RateLimit, LetsTheAskedRatePassAlsoWhereMessagesComeLate) {
  EXPECT_EQ(passed(1000.0, 1), 1000);
  EXPECT_EQ(passed(1000.0, 8), 1000);
  EXPECT_NEAR(passed(100.0, 1), 100, 2);
  EXPECT_NEAR(passed(30.0, 1), 30, 2);
  EXPECT_NEAR(passed(500.0, 4), 500, 6);
}

}  // namespace
}  // namespace subworld::ros2
