#include "device_sim/emulated_device.hpp"
#include "haptic_sim/loops/measures.hpp"
#include "haptic_sim/sub_world.hpp"
#include "support/allocations.hpp"
#include "support/temporary_folder.hpp"
#include "wire/codec/codec.hpp"
#include "world_sim/loops/measures.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace subworld {
namespace {

constexpr int kCycles = 10'000;
constexpr int kWarmUpCycles = 100;

/// `row`, pushed continuously, with a box that follows: bodies enter, leave, are touched and released all the time.
Scene pushed_row(const std::string& scheme) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  scene.settings.mode = Mode::realtime;  // in lock-step there is no deadline, and loops do not reserve memory
  scene.settings.scheme = scheme;
  keep_users(scene, 1);
  for (Body& body : scene.bodies) body.name += ", by a name that no short string holds";
  scene.users[0].box_half_m = 0.15;
  std::vector<PathSegment>& path = scene.users[0].device.path;
  path.clear();
  for (double t = 0.2; t < kCycles * scene.settings.shortest_cycle_s(); t += 2.0) {
    path.push_back({.from_s = t, .to_s = t + 1.0, .displacement = {0.13, 0.0, 0.0}});
    path.push_back({.from_s = t + 1.2, .to_s = t + 1.8, .displacement = {-0.10, 0.0, 0.0}});
  }
  return scene;
}

/// One topic, from the writer's sample to the reader's.
template <class M>
class Topic {
 public:
  void send(const M& sample) {
    if (!reader_.decode(writer_.encode(sample), received)) throw std::runtime_error("rejected");
  }
  M received;

 private:
  Codec<M> writer_, reader_;
};

class Loops : public testing::TestWithParam<const char*> {};

// All work of the three loops between two waits, with messages, histories and traces, while bodies enter and leave.
// Allocations of an engine do not count: Bullet allocates shapes and bodies that enter, and memory for their pairs.
TEST_P(Loops, AllocateNothingInTenThousandCycles) {
  const Scene scene = pushed_row(GetParam());
  World world(scene);
  world.settle([](double) { return true; });
  SubWorld sub(scene, 0);
  EmulatedDevice device(scene.users[0].device, 0);
  const TemporaryFolder folder;
  Options options;
  options.bodies = "all";
  options.out = folder.path();
  options.trace = folder.path() + "/world_trace.json";
  WorldMeasures world_measures(options, scene, {});
  options.trace = folder.path() + "/haptic_trace.json";
  HapticMeasures haptic_measures(options, scene, {});
  Topic<WorldFrame> frames;
  Topic<HapticReport> reports;
  Topic<DeviceState> states;
  Topic<DeviceCommand> commands;
  reserve(frames.received, kUsualMembers);
  reserve(reports.received, kUsualMembers);
  std::size_t entered = 0, border_pairs = 0;
  const auto cycle = [&] {
    frames.send(world.frame(0));
    entered += frames.received.entering.size();
    border_pairs += frames.received.border_contacts;
    sub.synchronise_with(frames.received);
    haptic_measures.stages().mark(HapticStage::synchronise);
    haptic_measures.synchronised(1e-4, 0);
    for (int i = 0; i < scene.settings.ratio; ++i) {
      states.send(device.state());
      const auto send = [&](const FeltStep& now) {
        commands.send(sub.command_for(states.received, now.to_operator));
        device.step(commands.received, scene.settings.h_s);
      };
      const FeltStep felt =
          sub.step({.device = &states.received, .wall_s = scene.settings.h_s, .dt = scene.settings.h_s}, send,
                   [&] { reports.send(*sub.close_cycle(1)); });
      haptic_measures.stages().mark(HapticStage::advance);
      haptic_measures.step(sub, felt, {1e-4, 1e-5, 1e-5, Miss::os});
      haptic_measures.end_step();
    }
    world.receive(std::move(reports.received));
    world.step();
    world_measures.stages().mark(WorldStage::simulate);
    world_measures.cycle(world, {1e-3, 1e-5, 1e-5, Miss::none}, 1.0, scene.settings.shortest_cycle_s());
    world_measures.bodies().record(world, scene.settings.shortest_cycle_s());
    world_measures.end_cycle();
  };
  for (int i = 0; i < kWarmUpCycles; ++i) cycle();
  long ours = 0, of_engines = 0;
  std::string places;
  {
    const test::AllocationWatch watch;
    for (int i = 0; i < kCycles; ++i) cycle();
    ours = watch.ours();
    of_engines = watch.of_engines();
    if (ours > 0) places = watch.places();
  }
  EXPECT_EQ(ours, 0) << places;
  RecordProperty("allocations_of_engines", std::to_string(of_engines));
  EXPECT_GT(entered, 10U);
  EXPECT_GT(border_pairs, 0U);
}

INSTANTIATE_TEST_SUITE_P(Schemes, Loops, testing::Values("paper", "reduced"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace subworld
