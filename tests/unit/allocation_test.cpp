#include "device_sim/emulated_device.hpp"
#include "haptic_sim/sub_world.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <string>

namespace {

std::atomic<long> allocations = 0;

}  // namespace

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace subworld {
namespace {

// What the loops do between two waits, on a scene with a border, once every buffer has found its size.
TEST(Loops, AllocateNothingInSteadyState) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
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
  for (int cycle = 0; cycle < 300; ++cycle) {
    const long before = allocations;
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
    if (cycle >= 100 && frame.entering.empty()) counted += allocations - before;
    received = report;
    border_pairs += frame.border.size();
  }
  EXPECT_GT(border_pairs, 0U);
  EXPECT_EQ(counted, 0);
}

}  // namespace
}  // namespace subworld
