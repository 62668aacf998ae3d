// Placement of a run's programs on cores.
#include "run/placement.hpp"

#include "io/options/options.hpp"

#include <gtest/gtest.h>

namespace subworld {
namespace {

Scene scene_for(int users, Mode mode = Mode::realtime) {
  Scene scene;
  scene.settings.mode = mode;
  scene.users.resize(static_cast<std::size_t>(users));
  for (UserSpec& user : scene.users) user.budget_ratio = 0.4;
  return scene;
}

const std::vector<int> kTwo{2, 5}, kFour{0, 1, 2, 3};

TEST(Placement, TheWorldTakesTheLastCoreAndTheOthersTheRest) {
  const Placement two = place(scene_for(2), kTwo);
  EXPECT_EQ(two.of("world_sim"), std::vector<int>{5});
  EXPECT_EQ(two.of("haptic_sim"), std::vector<int>{2});
  EXPECT_EQ(two.of("device_sim"), std::vector<int>{2});
  EXPECT_TRUE(two.of("gui_headless").empty());
  EXPECT_EQ(to_text(place(scene_for(4), kFour).others), "0,1,2");
}

TEST(Placement, AnEngineThatSharesItsStepsHasTheCoresThatTheOthersLeave) {
  Scene scene = scene_for(1);
  EXPECT_EQ(to_text(place(scene, kFour).world), "3") << "a preset that shares nothing";
  scene.settings.world.preset = "large";
  const Placement four = place(scene, kFour);
  EXPECT_EQ(to_text(four.world), "1,2,3");
  EXPECT_EQ(to_text(four.others), "0");
  EXPECT_EQ(to_text(place(scene, kTwo).world), "5");
  Options options;
  share_steps(options, scene, four);
  EXPECT_EQ(scene.settings.world.threads, 3);
  EXPECT_EQ(flag_of(options, "world.threads"), "--set world.threads");
  scene.settings.world.threads = 2;
  EXPECT_EQ(to_text(place(scene, kFour).world), "2,3");
  Scene many = scene_for(6);
  many.settings.world.preset = "large";
  EXPECT_EQ(place(many, std::vector<int>{0, 1, 2, 3, 4, 5}).others.size(), 4U) << "0.52 cores for each user";
}

TEST(Placement, NothingIsPlacedWhereTheHapticLoopsNeedAllCores) {
  EXPECT_TRUE(place(scene_for(3), kTwo).world.empty());
  EXPECT_TRUE(place(scene_for(8), kFour).of("haptic_sim").empty());
  EXPECT_TRUE(place(scene_for(1), std::vector<int>{0}).world.empty());
  EXPECT_TRUE(place(scene_for(2), kTwo, kFastKeys_s).world.empty());
  EXPECT_FALSE(place(scene_for(2), kTwo, kCycloneKeys_s).world.empty());
  EXPECT_FALSE(place(scene_for(1), kTwo, kFastKeys_s).world.empty());
}

TEST(Placement, BudgetsShareTheCores) {
  EXPECT_GT(budget_limit_ratio(scene_for(1), 2), 0.4) << "a default budget fits";
  EXPECT_NEAR(budget_limit_ratio(scene_for(4), 2), 0.121, 1e-12) << "half of the 0.97 cores that four users leave";
  EXPECT_NEAR(budget_limit_ratio(scene_for(40), 2), 0.02, 1e-12) << "room for the nearest members in any case";
  Scene slower = scene_for(4);
  slower.settings.h_s = 0.002;
  EXPECT_NEAR(budget_limit_ratio(slower, 2), 0.1855, 1e-12);
}

TEST(Placement, InLockStepNothingIsPlaced) { EXPECT_TRUE(place(scene_for(1, Mode::lockstep), kTwo).world.empty()); }

}  // namespace
}  // namespace subworld
