#include "coupling/messages/suppression.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "model/settings/optimisation.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <functional>

/// Cycles without messages: both sides know which ones are suppressed, and the felt force is that with all messages.
namespace subworld {
namespace {

Box cube(double half_m, double x, double y, double z) {
  return {Vec3(x, y, z) - Vec3::Constant(half_m), Vec3(x, y, z) + Vec3::Constant(half_m)};
}

WorldFrame frame_with(std::uint64_t stamp, std::uint64_t until) {
  WorldFrame frame;
  frame.stamp = stamp;
  frame.suppression = Suppression{until, cube(1.0, 0, 0, 0)};
  return frame;
}

TEST(SuppressedCycles, LackAllMessagesUntilTheyEnd) {
  SuppressedCycles suppression(1);
  EXPECT_FALSE(suppression.lacks_frame(1));
  suppression.begin(frame_with(10, 20));
  EXPECT_FALSE(suppression.may_lack_report(11)) << "it was on its way when the frame came";
  EXPECT_TRUE(suppression.may_lack_report(12));
  EXPECT_TRUE(suppression.may_lack_report(19));
  EXPECT_FALSE(suppression.may_lack_report(20));
  EXPECT_FALSE(suppression.lacks_report(12)) << "it may come yet";
  suppression.end(11);
  EXPECT_TRUE(suppression.lacks_frame(19));
  suppression.end(15);
  EXPECT_TRUE(suppression.lacks_report(14));
  EXPECT_FALSE(suppression.lacks_report(15));
  EXPECT_TRUE(suppression.lacks_frame(14));
  EXPECT_FALSE(suppression.lacks_frame(15));
}

TEST(SuppressedCycles, AreNeverMoreThanAreRemembered) {
  SuppressedCycles suppression(1);
  suppression.begin(frame_with(10, 1'000'000));
  EXPECT_FALSE(suppression.lacks_frame(10 + kMostSuppressedCycles));
}

TEST(FreePlace, IsCutWhereTheWayIsLongest) {
  const Box obstacle = cube(0.1, 0.5, 0.2, 0.0);
  const Box place = free_place(cube(1.0, 0, 0, 0), cube(0.05, 0, 0, 0), std::span(&obstacle, 1));
  EXPECT_DOUBLE_EQ(place.upper.x(), 0.4);
  EXPECT_DOUBLE_EQ(place.upper.y(), 1.0);
  EXPECT_TRUE(place.holds(cube(0.05, 0, 0, 0)));
}

TEST(FreePlace, DoesNotHoldWhatMeetsAnObstacle) {
  const Box obstacle = cube(0.1, 0.1, 0.0, 0.0);
  EXPECT_FALSE(free_place(cube(1.0, 0, 0, 0), cube(0.05, 0, 0, 0), std::span(&obstacle, 1)).holds(cube(0.05, 0, 0, 0)));
}

class LoneOperator : public ::testing::Test {
 protected:
  LoneOperator() { scene.settings.duration_s = 1.0; }

  struct Seen {
    std::vector<Vec3> felt;
    std::uint64_t cycles = 0, frames = 0, reports = 0;
  };
  Seen run(Disabled kept) const {
    Scene one = scene;
    one.settings.disable(kept);
    CoupledRun coupled(one);
    Seen seen;
    while (coupled.finite() && !coupled.world.facts().over) {
      coupled.cycle();
      ++seen.cycles;
      seen.frames += coupled.sent_frame();
      seen.reports += coupled.sent_report();
    }
    EXPECT_TRUE(coupled.finite());
    seen.felt = std::move(coupled.felt[0].force);
    return seen;
  }
  /// RMS of the felt force without message suppression, N, and the relative difference that suppression makes.
  std::pair<double, double> compare() const {
    const Seen out = run(kDisableNothing), in = run(disabled(Optimisation::suppression));
    EXPECT_EQ(in.reports, in.cycles);
    EXPECT_LT(out.reports, out.cycles);
    EXPECT_EQ(out.felt.size(), in.felt.size());
    double sum = 0.0;
    for (const Vec3& f : in.felt) sum += f.squaredNorm();
    return {std::sqrt(sum / static_cast<double>(in.felt.size())),
            force_error(out.felt, in.felt, scene.settings.h_s).rms};
  }

  Scene scene = [] {
    Scene row = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
    keep_users(row, 1);
    return row;
  }();
};

TEST_F(LoneOperator, SendsAFewMessagesASecond) {
  scene.users[0].device.path.clear();
  const Seen seen = run(kDisableNothing);
  EXPECT_EQ(seen.cycles, 251U) << "the sub-world is a cycle ahead";
  EXPECT_LT(seen.frames, 20U);
  EXPECT_LT(seen.reports, 30U);
}

// The world has one mean force for the whole suppressed period, and a spring to the path between its ends.
TEST_F(LoneOperator, IsAboutWhereItIsInTheWorldToo) {
  constexpr double kApart_m = 5e-3;  // of 32 mm in the longest suppressed period
  scene.users[0].device.path = {{.from_s = 0.1, .to_s = 0.5, .displacement = {-0.1, 0, 0}}};
  CoupledRun run(scene);
  const BodyId proxy = scene.users[0].proxy;
  std::uint64_t silent = 0;
  while (run.world.facts().time_s < 0.8) {
    run.cycle();
    if (run.world.facts().stamp == 0) continue;
    silent += !run.sent_frame();
    const BodyState& there = run.felt[0].proxy.at(run.world.timetable().start(run.world.facts().stamp) - 1);
    EXPECT_LT((run.world.engine().state(proxy).position - there.position).norm(), kApart_m) << run.world.facts().time_s;
  }
  EXPECT_GT(silent, 100U);
}

TEST_F(LoneOperator, EndsSuppressionBeforeItTouches) {
  // A fast motion that no frame predicts.
  scene.users[0].device.path = {{.from_s = 0.31, .to_s = 0.36, .displacement = {0.05, 0, 0}}};
  const auto [force_n, difference] = compare();
  EXPECT_GT(force_n, 1.0);
  EXPECT_LT(difference, 0.005);
}

TEST_F(LoneOperator, FeelsABodyThatIsThrownAtIt) {
  scene.users[0].device.path.clear();
  const Vec3 tool = scene.initial[index(scene.users[0].proxy)].position;
  test::throw_ball(scene, tool - Vec3(4.5, 0.0, 0.0), {5.0, 0.0, 0.0});  // 2 m away when the run begins
  const auto [force_n, difference] = compare();
  EXPECT_GT(force_n, 1.0);
  EXPECT_LT(difference, 0.005);
}

// The ball hits the far end of the sleeping row, whose other end then hits the tool.
TEST_F(LoneOperator, FeelsWhatSleepsAndIsHit) {
  scene.users[0].device.path.clear();
  Body& ball = test::throw_ball(scene, {2.0, 0.0, 0.05}, {-3.0, 0.0, 0.0});
  ball.mass = 4.0;
  ball.inertia *= 40.0;
  const auto [force_n, difference] = compare();
  EXPECT_GT(force_n, 1.0);
  EXPECT_LT(difference, 0.005);
}

}  // namespace
}  // namespace subworld
