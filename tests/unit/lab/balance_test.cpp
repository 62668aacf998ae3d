// The accounts of a run: momentum, energy and the copies of shared bodies.

#include "lab/coupling/balance.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/coupling/mutual.hpp"
#include "lab/coupling/sweep.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace subworld {
namespace {

Point point_of(const std::string& scene, const std::string& scheme, double duration_s) {
  Point point;
  point.scene = std::string(SCENES_FOLDER) + "/" + scene + ".yaml";
  point.scheme = scheme;
  point.ratio = 4;
  point.duration_s = duration_s;
  return point;
}

TEST(Balance, OfMomentumIsRelativeToAllForces) {
  MomentumBalance all;
  all.add({.missing_n_s = Vec3(0.1, 0, 0), .impulse_n_s = 2.0});
  all.add({.missing_n_s = Vec3(-0.1, 0.3, 0), .impulse_n_s = 1.0});
  EXPECT_NEAR(all.error_ratio(), 0.1, 1e-12) << "what one user lacks, another has too much of";
  EXPECT_TRUE(std::isnan(MomentumBalance{}.error_ratio()));
}

TEST(Balance, OfCopiesHasTheirRmsAndTheLargest) {
  CopyDifference copies;
  EXPECT_TRUE(std::isnan(copies.rms_m()));
  EXPECT_TRUE(std::isnan(copies.max_m()));
  copies.add(0.003);
  CopyDifference more;
  more.add(0.004);
  copies.add(more);
  EXPECT_NEAR(copies.rms_m(), 0.005 / std::sqrt(2.0), 1e-12);
  EXPECT_EQ(copies.max_m(), 0.004);
}

TEST(Balance, TheWorldReceivesWhatTheUsersGave) {
  for (const char* scheme : {"paper", "reduced"}) {
    const auto run = run_out(scene_of(point_of("row", scheme, 1.0)));
    ASSERT_GT(run->momentum.impulse_n_s, 0.5);
    EXPECT_LT(run->momentum.error_ratio(), 1e-9) << scheme;
  }
  // The last reports of a run are still on their way, and the world guesses them.
  Point late = point_of("row", "paper", 1.0);
  late.settings = {{"delay.latency_s", "0.1"}};
  const double on_the_way = run_out(scene_of(late))->momentum.error_ratio();
  EXPECT_GT(on_the_way, 1e-9);
  EXPECT_LT(on_the_way, 0.05);
  EXPECT_TRUE(std::isnan(run_out(scene_of(point_of("row", "direct", 0.3)))->momentum.error_ratio()))
      << "without a sub-world there is nothing to compare";
}

TEST(Balance, CopiesOfASharedBodyDifferMoreWithDelay) {
  Point point = point_of("lift", "reduced", 1.0);
  const auto now = run_out(scene_of(point));
  point.settings = {{"delay.latency_s", "0.05"}};
  const auto late = run_out(scene_of(point));
  for (std::size_t u = 0; u < 2; ++u) {
    EXPECT_LT(now->balance[u].copies.rms_m(), 1e-6);
    EXPECT_GT(late->balance[u].copies.rms_m(), 1e-5);
    EXPECT_GE(late->balance[u].copies.max_m(), late->balance[u].copies.rms_m());
  }
  const auto alone = run_out(scene_of(point_of("row", "reduced", 0.3)));
  EXPECT_TRUE(std::isnan(alone->balance[0].copies.rms_m())) << "one user shares nothing";
}

// A peer's device moves its proxy in the sub-world directly (scheme reduced), without a delay at once.
TEST(MutualLatency, IsNoneWithoutDelayAndGrowsWithIt) {
  References references;
  MutualLatencies mutual;
  double now_s = 0.0;
  for (const double latency_s : {0.0, 0.06}) {
    Point point = point_of("lift", "reduced", 1.6);
    point.settings = {{"delay.latency_s", std::to_string(latency_s)}};
    const Reference* reference = references.of(point);
    const auto run = run_out(scene_of(point));
    std::vector<std::optional<MutualLatency>> late(2);
    ASSERT_TRUE(mutual.measure(point, *run, *reference, late));
    for (std::size_t u = 0; u < 2; ++u) {
      ASSERT_TRUE(late[u]) << "both press the same cube";
      EXPECT_EQ(late[u]->of_user, 1 - u);
      EXPECT_GT(late[u]->reference_s, 0.0);
      EXPECT_LT(late[u]->reference_s, 0.02);
    }
    if (latency_s == 0.0) {
      now_s = late[0]->late_s;
      EXPECT_NEAR(now_s, 0.0, 0.001);
    } else {
      EXPECT_NEAR(late[0]->late_s - now_s, 0.5 * latency_s, 0.005) << "one way: the device sends to its peers too";
    }
  }
}

}  // namespace
}  // namespace subworld
