// Cost per cycle of resting cubes far from the operator: `row` beside fields of them, with the optimisation `rest` on
// and off, alternating cycle by cycle, in one run.

#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "lab/session/coupled_run.hpp"

#include <fmt/core.h>

#include <memory>
#include <string>
#include <vector>

namespace {

using namespace subworld;

/// `row` with `side` times `side` cubes beside it, at rest.
Scene row_beside(int side) {
  constexpr double kSpacing_m = 0.15, kAway_m = 3.0;
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  keep_users(scene, 1);
  const std::size_t pattern = 1;  // the row's first cube
  for (int i = 0; i < side * side; ++i) {
    Body cube = scene.bodies[pattern];
    cube.id = BodyId{static_cast<std::uint32_t>(scene.bodies.size())};
    cube.name = fmt::format("field/{}", i);
    cube.at_rest = true;
    BodyState state;
    state.position = Vec3(kSpacing_m * (i % side), kAway_m + kSpacing_m * (i / side), 0.05);
    scene.bodies.push_back(cube);
    scene.initial.push_back(state);
  }
  return scene;
}

int main_of(int argc, char** argv) {
  CommandLine line(
      "bench_world_size",
      "Measures a cycle of the world and a haptic step beside fields of resting cubes: median and p99, us.");
  std::vector<int> sides{16, 45, 90};
  int cycles = 250;
  line.add("--side", &sides, "cubes along a side of the field").range(1, 300);
  line.add("--cycles", &cycles, "cycles of the world").range(1, 1'000'000);
  if (const auto code = line.parse(argc, argv)) return *code;
  fmt::print("cubes,rest,world_p50_us,world_p99_us,haptic_p50_us,ratio_to_disabled_p50\n");
  for (const int side : sides) {
    Scene scene = row_beside(side);
    CoupledRun enabled(scene);
    scene.settings.disable(disabled(Optimisation::rest));
    CoupledRun disabled(scene);
    for (int i = 0; i < cycles; ++i) {
      enabled.cycle();
      disabled.cycle();
    }
    const double kept_s = disabled.cpu.world.quantile_s(0.5);
    for (const CoupledRun* run : {&enabled, &disabled}) {
      const double p50_s = run->cpu.world.quantile_s(0.5);
      fmt::print("{},{},{:.0f},{:.0f},{:.0f},{:.3f}\n", side * side, run == &enabled ? "on" : "off", 1e6 * p50_s,
                 1e6 * run->cpu.world.quantile_s(0.99), 1e6 * run->cpu.haptic.quantile_s(0.5), p50_s / kept_s);
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::guarded("bench_world_size", [&] { return main_of(argc, argv); });
}
