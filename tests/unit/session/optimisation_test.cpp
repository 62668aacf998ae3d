#include "coupling/plan.hpp"

#include "lab/session/coupled_run.hpp"
#include "model/scene/scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

// The facts that decide each optimisation, and that messages with less content have the same effect.
namespace subworld {
namespace {

Scene scene_of(const std::string& name, int users = 1) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  keep_users(scene, users);
  return scene;
}

struct Fact {
  const char* name;
  Optimisation optimisation;
  bool enabled;
  const char* scene;
  int users;
  std::function<void(Settings&)> set;
};

class Facts : public testing::TestWithParam<Fact> {};

TEST_P(Facts, Decide) {
  Scene scene = scene_of(GetParam().scene, GetParam().users);
  GetParam().set(scene.settings);
  EXPECT_EQ(enabled(scene, GetParam().optimisation), GetParam().enabled);
  EXPECT_FALSE(decision(scene, GetParam().optimisation).because.empty());
}

const auto kAsItIs = [](Settings&) {};
const auto kDirect = [](Settings& s) { s.scheme = "direct"; };
const auto kPaper = [](Settings& s) { s.scheme = "paper"; };

INSTANTIATE_TEST_SUITE_P(
    Items, Facts,
    testing::Values(
        Fact{"sway", Optimisation::sway, true, "row", 1, kAsItIs},
        Fact{"sway_weightless", Optimisation::sway, false, "row", 1, [](Settings& s) { s.world.gravity.setZero(); }},
        Fact{"sway_kept_awake", Optimisation::sway, false, "row", 1,
             [](Settings& s) { s.disable(disabled(Optimisation::rest)); }},
        Fact{"suppression", Optimisation::suppression, true, "row", 1, kAsItIs},
        Fact{"suppression_direct", Optimisation::suppression, false, "row", 1, kDirect},
        Fact{"suppression_paper", Optimisation::suppression, false, "row", 1, kPaper},
        Fact{"suppression_realtime", Optimisation::suppression, false, "row", 1,
             [](Settings& s) { s.mode = Mode::realtime; }},
        Fact{"suppression_two_users", Optimisation::suppression, false, "lift", 2, kAsItIs},
        Fact{"suppression_delay", Optimisation::suppression, false, "row", 1, [](Settings& s) { s.delay.up_s = 0.01; }},
        Fact{"suppression_ratio", Optimisation::suppression, false, "heap", 1, kAsItIs},
        Fact{"device", Optimisation::device, true, "row", 1, kAsItIs},
        Fact{"device_direct", Optimisation::device, false, "row", 1, kDirect},
        Fact{"device_two_users", Optimisation::device, false, "lift", 2, kAsItIs},
        Fact{"device_two_users_paper", Optimisation::device, true, "lift", 2, kPaper},
        Fact{"changes", Optimisation::changes, true, "heap", 2, kAsItIs},
        Fact{"changes_paper", Optimisation::changes, true, "row", 1, kPaper},
        Fact{"changes_direct", Optimisation::changes, false, "row", 1, kDirect},
        Fact{"overruled", Optimisation::overruled, true, "heap", 2, kAsItIs},
        Fact{"overruled_paper", Optimisation::overruled, false, "row", 1, kPaper},
        Fact{"overruled_direct", Optimisation::overruled, false, "row", 1, kDirect},
        Fact{"overruled_turning_tool", Optimisation::overruled, false, "turn", 1, kAsItIs},
        Fact{"pairs", Optimisation::pairs, true, "row", 1, kAsItIs},
        Fact{"pairs_paper", Optimisation::pairs, false, "row", 1, kPaper},
        Fact{"pairs_direct", Optimisation::pairs, false, "row", 1, kDirect}),
    [](const auto& one) { return std::string(one.param.name); });

class SameMessages : public testing::TestWithParam<const char*> {};

// Ghosts appear, change from carried to held, and end.
TEST_P(SameMessages, HaveTheSameEffectOnASubWorld) {
  std::vector<std::uint64_t> hashes;
  for (const Disabled disabled : {kDisableNothing, disabled(Optimisation::pairs) | disabled(Optimisation::device)}) {
    Scene scene = scene_of(GetParam());
    scene.settings.duration_s = 1.6;
    scene.settings.disable(disabled);
    CoupledRun run(scene);
    EXPECT_TRUE(run.run());
    hashes.push_back(run.hash());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SameMessages, testing::Values("loose", "see_saw", "toppling", "hidden_load"),
                         [](const auto& one) { return std::string(one.param); });

// A ghost that is held again starts where its contacts are no deeper than in the world: this needs its contacts.
TEST(Pairs, GoWithGhostsThatAreHeldAgain) {
  std::size_t held_again = 0;
  for (const char* name : {"loose", "toppling", "hidden_load", "pyramid"}) {
    Scene scene = scene_of(name);
    scene.settings.duration_s = 2.5;
    CoupledRun run(scene);
    std::vector<GhostModel> before;
    while (run.finite() && run.world.facts().time_s < scene.settings.duration_s) {
      run.cycle();
      const WorldFrame& frame = run.frame();
      for (const GhostModel& ghost : frame.ghosts) {
        const auto then = std::ranges::find(before, ghost.outside, &GhostModel::outside);
        if (then == before.end() || !then->carried || ghost.carried) continue;
        const auto count = [&](std::span<const BoundaryContact> pairs) {
          return std::ranges::count(pairs, ghost.outside, &BoundaryContact::outside);
        };
        held_again += count(run.world.user_facts(0).border) > 0;
        EXPECT_EQ(count(frame.border), count(run.world.user_facts(0).border)) << name << " at " << frame.stamp_s;
      }
      before = frame.ghosts;
    }
  }
  EXPECT_GT(held_again, 0U);
}

}  // namespace
}  // namespace subworld
