#include "device_sim/emulated_device.hpp"
#include "haptic_sim/sub_world.hpp"
#include "support/allocations.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {
namespace {

// What the loops do between two waits, on a scene with a border, once every buffer has found its size.
class Loops : public testing::TestWithParam<const char*> {};

TEST_P(Loops, AllocateNothingInSteadyState) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  scene.settings.scheme = GetParam();
  keep_users(scene, 1);
  World world(scene);
  world.settle([](double) { return true; });
  SubWorld sub(scene, 0);
  EmulatedDevice device(scene.users[0].device, 0);
  sub.apply(world.frame(0));
  HapticReport received = sub.report(1);
  WorldFrame frame;
  reserve(frame, kUsualMembers);
  reserve(received, kUsualMembers);
  long counted = 0;
  std::size_t border_pairs = 0;
  std::vector<BodyId> ghosts;
  for (int cycle = 0; cycle < 300; ++cycle) {
    const long before = test::allocations();
    world.receive(std::move(received));
    world.step();
    for (int i = 0; i < scene.settings.ratio; ++i) {
      DeviceCommand command;
      command.wrench = sub.step(device.state(), true, scene.settings.h_s).to_hand;
      device.step(command, scene.settings.h_s);
    }
    const HapticReport& report = sub.report(1);
    frame = world.frame(0);
    sub.apply(frame);
    // A cycle in which bodies enter or leave may allocate: the engine makes them.
    const long made = test::allocations() - before;
    const bool same = frame.entering.empty() && std::ranges::equal(frame.ghosts, ghosts, {}, &GhostModel::outside);
    if (cycle >= 100 && same) counted += made;
    ghosts.clear();
    for (const GhostModel& ghost : frame.ghosts) ghosts.push_back(ghost.outside);
    received = report;
    border_pairs += frame.border.size();
  }
  EXPECT_GT(border_pairs, 0U);
  EXPECT_EQ(counted, 0);
}

INSTANTIATE_TEST_SUITE_P(Schemes, Loops, testing::Values("paper", "reduced"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace subworld
