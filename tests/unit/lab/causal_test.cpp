// The bound of causality.

#include "lab/coupling/causal.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/coupling/sweep.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace subworld {
namespace {

Point late(const std::string& scene, double latency_s, double duration_s) {
  Point point;
  point.scene = std::string(SCENES_FOLDER) + "/" + scene + ".yaml";
  point.scheme = "direct";
  point.ratio = 4;
  point.duration_s = duration_s;
  point.settings = {{"users.device.profile", "constant"}, {"delay.latency_s", std::to_string(latency_s)}};
  return point;
}

TEST(CausalError, IsNoneWithoutDelayAndOfASingleUser) {
  References references;
  EXPECT_EQ(references.causal_of(late("row", 0.1, 0.4))->all, 0.0);
  const CausalErrors* const now = references.causal_of(late("lift", 0.0, 0.4));
  EXPECT_EQ(now->all, 0.0);
  EXPECT_EQ(now->by_user, (std::vector{0.0, 0.0}));
}

// What jumps in velocity cannot be predicted; and a peer in steady motion can, which no scheme without prediction uses.
TEST(CausalError, IsThatOfAnUnpredictablePeer) {
  References references;
  const Point point = late("carry", 0.05, 1.35);
  const CausalErrors* const causal = references.causal_of(point);
  EXPECT_GT(causal->all, 0.01);
  const Scene scene = scene_of(point);
  const double unpredicted = force_error(run_out(scene)->felt, references.run_of(point)->felt, scene.settings.h_s).rms;
  EXPECT_LT(causal->all, 0.5 * unpredicted);
  EXPECT_LT(references.causal_of(late("carry", 0.01, 1.35))->all, causal->all);
}

TEST(CausalError, IsNoneBesideAPeerAtRest) {
  const Point point = late("lift", 0.05, 0.9);
  Scene scene = reference_scene_of(point);
  scene.users[1].device.path.clear();
  scene.initial[index(scene.users[1].proxy)].position.x() = 0.081;  // the other one pushes the cube against it
  const auto causal = causal_errors_of(scene, scene_of(point).settings.delay, *run_out(scene));
  EXPECT_EQ(causal->by_user[0], 0.0);
  EXPECT_GT(causal->by_user[1], 0.001);
}

// With the oracle, the error of a delay is that of its predictions.
TEST(Oracle, LeavesTheErrorWithoutDelay) {
  References references;
  const auto error = [&](double latency_s, const char* oracle) {
    Point point = late("carry", latency_s, 1.35);
    point.scheme = "reduced";
    point.oracle = oracle;
    const Scene scene = scene_of(point);
    const auto run = run_out(scene, prepare_of(point));
    return force_error(run->felt, references.run_of(point)->felt, scene.settings.h_s).rms;
  };
  const double now = error(0.0, "off");
  EXPECT_EQ(error(0.0, "on"), now);
  EXPECT_NEAR(error(0.05, "on"), now, 0.002);
  EXPECT_GT(error(0.05, "off"), now + 0.02);
}

TEST(CausalError, BoundsErrorsTogetherWithTheReferenceError) {
  EXPECT_TRUE(at_bound(0.010, 0.02, 0.0));
  EXPECT_TRUE(at_bound(0.054, 0.02, 0.05));
  EXPECT_FALSE(at_bound(0.056, 0.02, 0.05));
  EXPECT_FALSE(at_bound(0.056, 0.2, 0.05)) << "such a reference says nothing";
  EXPECT_FALSE(at_bound(NAN, 0.02, 0.05));
}

}  // namespace
}  // namespace subworld
