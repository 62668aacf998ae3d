// Any engine for the world, any for the sub-world: the felt force follows the reference of the world's engine.
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "physics/engine.hpp"

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace subworld {
namespace {

/// RMS error of the felt force, for the row in which the design states its errors, and for a scene with a load on the
/// border.
struct Case {
  std::string scene;
  double bar;
};
const Case kCases[] = {{"row", 0.03}, {"hidden_load", 0.06}};

Scene scene_of(const std::string& name, const std::string& scheme, int ratio, const std::string& world,
               const std::string& haptic) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.users = 1;
  scene.settings.scheme = scheme;
  scene.settings.ratio = ratio;
  scene.settings.world.name = world;
  scene.settings.haptic.name = haptic;
  return scene;
}

class WorldEngine : public testing::TestWithParam<std::string> {};

TEST_P(WorldEngine, IsFollowedByEverySubWorldEngine) {
  const std::string& world = GetParam();
  for (const auto& [name, bar] : kCases) {
    CoupledRun reference(scene_of(name, "direct", 1, world, world));
    ASSERT_TRUE(reference.run());
    for (const std::string& haptic : engine_names()) {
      CoupledRun run(scene_of(name, "reduced", 4, world, haptic));
      ASSERT_TRUE(run.run());
      const ForceError error = force_error(run.felt[0].force, reference.felt[0].force, 0.001);
      // With seven digits, rounding is part of the error; both errors then vary by one percentage point.
      const bool rounded = world == "bullet_float" || haptic == "bullet_float";
      EXPECT_LE(error.rms, rounded ? bar + 0.01 : bar) << name << ": world " << world << ", sub-world " << haptic;
      std::printf("%s: world %s, sub-world %s: RMS %.2f %%\n", name.c_str(), world.c_str(), haptic.c_str(),
                  100.0 * error.rms);
    }
  }
}

// Also with engines that estimate friction only on request.
TEST_P(WorldEngine, ReportsTheFrictionAtTheBorder) {
  CoupledRun run(scene_of("pyramid", "reduced", 4, GetParam(), "bullet"));
  double normal = 0.0, tangential = 0.0;
  while (run.world.facts().time_s < 1.5) {
    run.cycle();
    for (const BoundaryContact& pair : run.world.user_facts(0).border) {
      normal += pair.normal_impulse;
      tangential += pair.tangential_impulse.norm();
    }
  }
  EXPECT_GT(normal, 0.0);
  EXPECT_GT(tangential, 0.02 * normal);
  EXPECT_LT(tangential, 0.5 * 1.01 * normal) << "friction is 0.5";
}

INSTANTIATE_TEST_SUITE_P(Engines, WorldEngine, testing::ValuesIn(engine_names()),
                         [](const testing::TestParamInfo<std::string>& named) { return named.param; });

}  // namespace
}  // namespace subworld
