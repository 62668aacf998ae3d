// A world, the sub-world of its first user and an emulated device in one process, without messages. The state hash is
// that of `subworld run SCENE --users 1 --mode lockstep --disable suppression`.
#include "device_sim/device_guard.hpp"
#include "device_sim/emulated_device.hpp"
#include "haptic_sim/lockstep_order.hpp"
#include "io/options/scene_name.hpp"
#include "model/error.hpp"
#include "world_sim/world.hpp"

#include <fmt/core.h>
#include <algorithm>

using namespace subworld;

static void simulate(const Scene& scene) {
  World world(scene);
  world.settle([](double) { return true; });
  SubWorld sub_world(scene, 0);
  EmulatedDevice device(scene.users[0].device, 0);
  DeviceGuard guard(scene, 0, 0.0);
  LockstepOrder order(scene, 0);
  const auto report = [&] { world.receive(HapticReport(*sub_world.close_cycle(1))); };
  const auto take_frame = [&](std::uint64_t stamp) {
    if (stamp > world.facts().stamp) return false;
    sub_world.synchronise_with(world.frame(0));
    return true;
  };
  DeviceCommand command;
  const auto take_command = [&](const DeviceCommand& made, const FeltStep&) { command = made; };
  sub_world.synchronise_with(world.frame(0));
  report();
  double largest_n = 0.0;
  for (std::uint64_t cycle = 0; !world.facts().over; ++cycle) {
    for (int step = 0; step < sub_world.clock().timetable().ratio(cycle); ++step) {
      order.take_frames(sub_world, take_frame);
      order.step(sub_world, device.state(), take_command, report);
      const DeviceCommand safe = guard.pass(command, device.state(), true, scene.settings.h_s);
      largest_n = std::max(largest_n, safe.wrench.force.norm());
      device.step(safe, scene.settings.h_s);
    }
    order.take_frames(sub_world, take_frame);
    // The scheme `reduced` works one cycle ahead of the world.
    if (cycle >= static_cast<std::uint64_t>(scheme_of(scene.settings).properties.lead_cycles)) world.step();
    order.take_frames(sub_world, take_frame);
  }
  world.close();
  fmt::print("largest force {:.3f} N, state hash {:016x}\n", largest_n, world.facts().state_hash);
}

int main(int argc, char** argv) try {
  if (argc != 2) throw Error(ExitCode::usage, "usage: in_process SCENE");
  Scene scene = load_scene(scene_file(argv[1]));
  keep_users(scene, 1);
  scene.settings.disable(disabled(Optimisation::suppression));  // each cycle has a report and a frame
  simulate(scene);
} catch (const Error& error) {
  fmt::print(stderr, "{}\n", error.what());
  return static_cast<int>(error.code());
}
