#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"

#include <gtest/gtest.h>

#include <string>

namespace subworld {
namespace {

struct Turning {
  int ratio;
  double latency_s;
  double most_force, most_torque;  ///< RMS errors
};

Scene rows_scene(const std::string& scheme, int ratio, double latency_s = 0.0) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/turn_rows.yaml");
  keep_users(scene, 1);
  scene.settings.scheme = scheme;
  scene.settings.set_ratio({ratio, ratio});
  scene.settings.world.substeps = 1;
  scene.settings.delay.up_s = scene.settings.delay.down_s = 0.5 * latency_s;
  return scene;
}

class TurningTool : public testing::TestWithParam<Turning> {};

// The limits are 1.2 to 1.8 times what common/coupling/RESULTS.md reports. Without delay, a world that keeps its own
// orientations exceeds them: a body that friction holds creeps faster in its longer step.
TEST_P(TurningTool, IsFeltAsInOneWorld) {
  const Turning& c = GetParam();
  CoupledRun reference(rows_scene("direct", 1));
  ASSERT_TRUE(reference.run());
  const Scene scene = rows_scene("reduced", c.ratio, c.latency_s);
  CoupledRun coupled(scene);
  ASSERT_TRUE(coupled.run());
  const FeltHistory& felt = coupled.felt[0];
  EXPECT_LE(force_error(felt.force, reference.felt[0].force, scene.settings.h_s).rms, c.most_force);
  EXPECT_LE(force_error(felt.torque, reference.felt[0].torque, scene.settings.h_s).rms, c.most_torque);
  EXPECT_LE(coupled.world.facts().energy_excess_j, 1e-3 * coupled.subs[0]->facts().device_work_j);
}

INSTANTIATE_TEST_SUITE_P(Ratios, TurningTool,
                         testing::Values(Turning{4, 0.0, 0.026, 0.008}, Turning{10, 0.0, 0.03, 0.013},
                                         Turning{20, 0.0, 0.045, 0.025}, Turning{5, 0.02, 0.04, 0.016},
                                         Turning{5, 0.1, 0.04, 0.02}),
                         [](const auto& tested) {
                           return "r" + std::to_string(tested.param.ratio) + "_" +
                                  std::to_string(static_cast<int>(1e3 * tested.param.latency_s)) + "_ms";
                         });

}  // namespace
}  // namespace subworld
