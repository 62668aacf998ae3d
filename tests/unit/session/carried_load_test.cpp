// What tools carry, from the first frame on, with and without delay: against the same scene in one world.
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <string>

namespace subworld {
namespace {

constexpr const char* kHeader = R"(
name: carried
settings:
  duration_s: {duration}
  settle: {{duration_s: 0.5, step_s: 0.004}}
  world: {{preset: fast}}
  haptic: {{preset: fast}}
materials:
  plain: {{friction: 0.5, restitution: 0}}
bodies:
  - {{name: floor, shape: plane, fixed: true, material: plain}}
)";

/// A bar lies on two tools with six degrees of freedom.
constexpr const char* kBar = R"(
  - {name: bar, shape: box, size_m: [0.6, 0.06, 0.06], mass_kg: 0.6, material: plain, position_m: [0, 0, 0.53]}
users:
  - name: left
    proxy: {shape: box, size_m: [0.08, 0.1, 0.04], mass_kg: 0.1, position_m: [-0.25, 0, 0.48], gravity: false, material: plain}
    device: {degrees_of_freedom: 6}
  - name: right
    proxy: {shape: box, size_m: [0.08, 0.1, 0.04], mass_kg: 0.1, position_m: [0.25, 0, 0.48], gravity: false, material: plain}
    device: {degrees_of_freedom: 6}
)";

/// A tray, the tool, with nine cubes and nine more on top of them: each of those lies on up to four.
constexpr const char* kTray = R"(
  - {name: low, shape: box, size_m: [0.06, 0.06, 0.06], mass_kg: 0.1, material: plain, position_m: [-0.07, -0.07, 0.53],
     repeat: {grid: {counts: [3, 3, 1], spacing_m: [0.07, 0.07, 0.06]}}}
  - {name: high, shape: box, size_m: [0.06, 0.06, 0.06], mass_kg: 0.1, material: plain, position_m: [-0.045, -0.055, 0.59],
     repeat: {grid: {counts: [3, 3, 1], spacing_m: [0.065, 0.065, 0.06]}}}
users:
  - name: waiter
    proxy: {shape: box, size_m: [0.4, 0.4, 0.04], mass_kg: 0.3, position_m: [0, 0, 0.48], rotates: false, gravity: false, material: plain}
    selection: box
    box_half_m: 0.01
    device: {force_limit_n: 60, path: [{move: [0, 0, 0.04], during_s: [0.1, 0.4]}, {move: [0.02, 0, 0], during_s: [0.5, 0.8]}]}
)";

/// A block lies on a tool, which lifts it, and lowers it below where it began.
constexpr const char* kBlock = R"(
  - {name: block, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 2, material: plain, position_m: [0, 0, 0.55]}
users:
  - name: lifter
    proxy: {shape: box, size_m: [0.3, 0.3, 0.04], mass_kg: 0.2, position_m: [0, 0, 0.48], rotates: false, gravity: false, material: plain}
    device: {force_limit_n: 40, path: [{move: [0, 0, 0.1], during_s: [0.1, 0.5]}, {move: [0, 0, -0.3], during_s: [0.6, 1.8]}]}
)";

Scene carried(const char* bodies, double duration_s, const std::string& scheme, int ratio, double latency_s) {
  Scene scene = load_text(fmt::format(fmt::runtime(kHeader), fmt::arg("duration", duration_s)) + bodies);
  scene.settings.users = static_cast<int>(scene.users.size());
  scene.settings.scheme = scheme;
  scene.settings.set_ratio({ratio, ratio});
  scene.settings.delay.up_s = scene.settings.delay.down_s = 0.5 * latency_s;
  return scene;
}

struct Felt {
  double by_sub_world, by_operator;  ///< RMS errors of the worst user
  double created_j;
};

Felt felt(const char* bodies, double duration_s, int ratio, double latency_s) {
  CoupledRun reference(carried(bodies, duration_s, "direct", 1, 0.0));
  CoupledRun coupled(carried(bodies, duration_s, "reduced", ratio, latency_s));
  EXPECT_TRUE(reference.run() && coupled.run());
  Felt worst{};
  for (std::size_t u = 0; u < coupled.felt.size(); ++u) {
    const FeltHistory &is = coupled.felt[u], &should = reference.felt[u];
    worst.by_sub_world = std::max(worst.by_sub_world, force_error(is.force, should.force, 1e-3).rms);
    worst.by_operator = std::max(worst.by_operator, force_error(is.on_operator, should.on_operator, 1e-3).rms);
    worst.created_j += coupled.guards[u]->port().created_j() + reference.guards[u]->port().created_j();
  }
  return worst;
}

// Until a sub-world has heard of a peer, and the world of its users, the couplings hold the proxies where they start.
TEST(CarriedLoad, RestsOnTwoToolsFromTheFirstFrameOn) {
  EXPECT_LT(felt(kBar, 0.3, 20, 0.0).by_sub_world, 1e-4);
  EXPECT_LT(felt(kBar, 0.3, 5, 0.1).by_sub_world, 1e-3);
}

TEST(CarriedLoad, OfManyCubesCountsOnce) {
  EXPECT_LT(felt(kTray, 1.0, 4, 0.0).by_sub_world, 0.005);
  EXPECT_LT(felt(kTray, 1.0, 10, 0.02).by_sub_world, 0.005);
}

TEST(CarriedLoad, GivesBackItsEnergyWhenItIsLowered) {
  const Felt lowered = felt(kBlock, 2.0, 5, 0.02);
  EXPECT_LT(lowered.by_operator, 0.01);
  EXPECT_LT(lowered.created_j, 1e-3);
}

}  // namespace
}  // namespace subworld
