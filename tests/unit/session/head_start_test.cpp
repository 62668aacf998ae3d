// The head start of the haptic clock over a link whose delay changes: what the world has when it needs it.
#include "haptic_sim/loops/head_start.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace subworld {
namespace {

constexpr double kWorldCycle_s = 0.004;

/// A world and a haptic clock that is `head_start_s` ahead of the frames; it moves towards a new one by a tenth of the
/// time that passes. A report takes `up_s`, a frame `down_s`.
struct Bed {
  HeadStart head_start;
  double clock_s;  ///< the head start that the haptic clock has
  std::vector<double> late = {};

  explicit Bed(double round_trip_s) : head_start(round_trip_s, kWorldCycle_s), clock_s(head_start.head_start_s()) {}

  template <class RoundTrip>
  void run(int frames, RoundTrip round_trip_s) {
    late.clear();
    for (int j = 0; j < frames; ++j) {
      // A report is written so long before the frame of its stamp arrives; the world reads once a cycle.
      const double late_s = round_trip_s(j) - clock_s;
      const double cycles = std::ceil(late_s / kWorldCycle_s);
      late.push_back(cycles);
      const auto stamp = static_cast<std::uint64_t>(1000 + j);
      head_start.observe(stamp, static_cast<std::uint64_t>(static_cast<double>(stamp) - cycles), kWorldCycle_s);
      clock_s += std::clamp(head_start.head_start_s() - clock_s, -0.1 * kWorldCycle_s, 0.1 * kWorldCycle_s);
    }
  }
  [[nodiscard]] double late_ratio(std::size_t last) const {
    double count = 0.0;
    for (std::size_t i = late.size() - last; i < late.size(); ++i) count += late[i] > 0.0;
    return count / static_cast<double>(last);
  }
};

TEST(HeadStart, IsTheRoundTripOfTheHandshakeAndStays) {
  Bed bed(0.1);
  const double begin_s = bed.head_start.head_start_s();
  EXPECT_NEAR(begin_s, 0.102, 1e-12);
  bed.run(1000, [](int) { return 0.1; });
  EXPECT_EQ(bed.head_start.head_start_s(), begin_s);
  EXPECT_EQ(bed.late_ratio(1000), 0.0);
}

TEST(HeadStart, FollowsALinkThatGetsSlowerAndFasterWithoutOvershoot) {
  Bed bed(0.02);
  bed.run(2000, [](int) { return 0.08; });
  EXPECT_EQ(bed.late_ratio(200), 0.0);
  EXPECT_LT(bed.head_start.head_start_s(), 0.08 + 2.0 * kWorldCycle_s);
  bed.run(6000, [](int) { return 0.01; });
  EXPECT_EQ(bed.late_ratio(200), 0.0);
  EXPECT_LT(bed.head_start.head_start_s(), 0.01 + 4.0 * kWorldCycle_s)
      << "frames need not be older than the link makes them";
}

TEST(HeadStart, WithJitterMostReportsAreInTime) {
  Bed bed(0.05);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> jitter(-0.02, 0.02);
  bed.run(4000, [&](int) { return 0.05 + jitter(random); });
  EXPECT_LT(bed.late_ratio(1000), 0.3);
  EXPECT_LT(bed.head_start.head_start_s(), 0.08);
}

TEST(HeadStart, NoWorldMakesItLongerThanItsBound) {
  Bed bed(3.0);
  EXPECT_EQ(bed.head_start.head_start_s(), HeadStart::kMost_s);
  bed.run(4000, [](int) { return 2.0; });
  EXPECT_EQ(bed.head_start.head_start_s(), HeadStart::kMost_s);
}

}  // namespace
}  // namespace subworld
