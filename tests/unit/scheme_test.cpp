#include "coupling/border.hpp"
#include "support/coupled_run.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace subworld {
namespace {

using test::CoupledRun;
using test::rms_error;

Scene scene_of(const std::string& name, const std::string& scheme, int ratio) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.scheme = scheme;
  scene.settings.ratio = ratio;
  keep_users(scene, scene.settings.users == 0 ? static_cast<int>(scene.users.size()) : scene.settings.users);
  return scene;
}

struct Seen {
  std::size_t border_pairs = 0;
  std::size_t fewest_members = 1000;
  std::size_t most_members = 0;
};

Seen run_all(CoupledRun& run, double duration_s) {
  Seen seen;
  while (run.world.time_s() < duration_s - 1e-9) {
    run.cycle();
    seen.border_pairs = std::max(seen.border_pairs, run.frame().border.size());
    seen.fewest_members = std::min(seen.fewest_members, run.frame().members.size());
    seen.most_members = std::max(seen.most_members, run.frame().members.size());
  }
  return seen;
}

class ClosedScene : public testing::TestWithParam<std::tuple<std::string, int>> {};

// No border, no error: the reference is the whole scene in one world at the haptic step.
TEST_P(ClosedScene, PaperFollowsTheReferenceWithinOnePercent) {
  const auto& [name, ratio] = GetParam();
  CoupledRun reference(scene_of(name, "direct", 1));
  reference.run();
  CoupledRun paper(scene_of(name, "paper", ratio));
  const Seen seen = run_all(paper, scene_of(name, "paper", ratio).settings.duration_s);
  EXPECT_EQ(seen.border_pairs, 0U);
  ASSERT_FALSE(reference.felt[0].empty());
  EXPECT_GT(std::max_element(reference.felt[0].begin(), reference.felt[0].end(),
                             [](const Vec3& a, const Vec3& b) { return a.norm() < b.norm(); })
                ->norm(),
            1.0);
  EXPECT_LE(rms_error(paper.felt[0], reference.felt[0]), 0.01);
}

INSTANTIATE_TEST_SUITE_P(Scenes, ClosedScene,
                         testing::Combine(testing::Values("press", "scatter"), testing::Values(1, 4, 10)),
                         [](const auto& tested) {
                           return std::get<0>(tested.param) + "_r" + std::to_string(std::get<1>(tested.param));
                         });

// Figure 8 b: the proxy in the middle of a stack. The sub-world's ends are border bodies, and they carry the load of
// the cubes that are outside: without border impulses the lower members would fall.
TEST(Figure8b, BorderImpulsesCarryTheStackOutside) {
  Scene scene = scene_of("tower_inside", "paper", 4);
  scene.settings.settle_s = 3.0;  // until the stack no longer rings
  CoupledRun run(scene);
  const WorldFrame& frame = run.frame();
  ASSERT_FALSE(frame.border.empty());
  Vec3 up = Vec3::Zero();
  Vec3 down = Vec3::Zero();
  for (const BorderPair& pair : frame.border) (pair.normal.z() > 0.0 ? up : down) += pair.normal_impulse * pair.normal;
  const double cycle_s = 0.004;
  std::size_t below = 0, above = 0;
  double lowest = 1e9, highest = -1e9;
  for (const StampedBody& s : frame.states) {
    lowest = std::min(lowest, s.state.position.z());
    highest = std::max(highest, s.state.position.z());
  }
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    below += scene.initial[index(body.id)].position.z() < lowest - 0.05;
    above += scene.initial[index(body.id)].position.z() > highest + 0.05;
  }
  ASSERT_GT(below, 0U);
  ASSERT_GT(above, 0U);
  EXPECT_NEAR(-down.z() / cycle_s, static_cast<double>(above) * 0.2 * 9.81,
              0.1 * static_cast<double>(above) * 0.2 * 9.81);  // the weight above presses down
  EXPECT_GT(up.z(), -down.z());                                // what stands below holds up more
}

// Figure 9: every border contact has exactly one of its bodies inside.
TEST(Figure9, BorderContactsCrossTheBoundary) {
  CoupledRun run(scene_of("row", "paper", 4));
  for (int i = 0; i < 100; ++i) run.cycle();
  const WorldFrame& frame = run.frame();
  ASSERT_FALSE(frame.border.empty());
  for (const BorderPair& pair : frame.border) {
    EXPECT_TRUE(std::binary_search(frame.members.begin(), frame.members.end(), pair.inside));
    EXPECT_FALSE(std::binary_search(frame.members.begin(), frame.members.end(), pair.outside));
    EXPECT_FALSE(std::binary_search(frame.fixed.begin(), frame.fixed.end(), pair.outside));
  }
}

// Figure 10: only the base of a tower is inside, yet its friction is that of the whole tower: a push that would move
// the base alone does not move it.
TEST(Figure10, TheBaseFeelsTheTowerAboveIt) {
  CoupledRun run(scene_of("tower_base", "paper", 4));
  const Scene scene = scene_of("tower_base", "paper", 4);
  const WorldFrame& frame = run.frame();
  const auto movable = static_cast<std::size_t>(
      std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return !b.fixed(); }));
  ASSERT_LT(frame.members.size(), movable);
  ASSERT_FALSE(frame.border.empty());
  double pressed = 0.0;
  for (const BorderPair& pair : frame.border) pressed -= pair.normal_impulse * pair.normal.z();
  const double outside = static_cast<double>(movable - frame.members.size()) * 0.2 * 9.81 * 0.004;
  EXPECT_NEAR(pressed, outside, 0.1 * outside);
}

// Figure 14: three of the ten cubes are members, and the whole row is felt.
TEST(Figure14, TheRowIsFeltThroughThreeCubes) {
  CoupledRun run(scene_of("row", "paper", 4));
  run.cycle();
  EXPECT_EQ(run.frame().members.size(), 4U);  // with the proxy
  while (run.world.time_s() < 2.0) run.cycle();
  const double sliding = 10 * 0.5 * 0.2 * 9.81;  // mu m g of all ten
  double most = 0.0;
  for (const Vec3& f : run.felt[0]) most = std::max(most, std::abs(f.x()));
  EXPECT_GT(most, 0.8 * sliding);
  EXPECT_GT(run.world.description(0).states[index(scene_of("row", "paper", 4).users[0].proxy)].position.x(), -0.08);
}

TEST(Membership, BodiesEnterAndLeaveWhileRunning) {
  CoupledRun run(scene_of("scatter", "paper", 4));
  const Seen seen = run_all(run, 2.0);
  EXPECT_LT(seen.fewest_members, seen.most_members);
  EXPECT_EQ(run.subs[0]->members(), run.frame().members.size());
}

TEST(Lockstep, EqualRunsHaveEqualHashes) {
  const auto hash = [] {
    CoupledRun run(scene_of("row", "paper", 4));
    for (int i = 0; i < 100; ++i) run.cycle();
    return run.world.state_hash();
  };
  EXPECT_EQ(hash(), hash());
}

}  // namespace
}  // namespace subworld
