// A run whose devices send only what their operators can tell from its extrapolation.
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"

#include <gtest/gtest.h>

#include <string>

namespace subworld {
namespace {

Scene late_scene(const std::string& name, int users, double deadband) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  keep_users(scene, users);
  scene.settings.duration_s = 1.0;
  scene.settings.deadband = deadband;
  return scene;
}

class DeadbandRun : public testing::TestWithParam<std::pair<const char*, int>> {};

TEST_P(DeadbandRun, of_ten_per_cent_saves_two_thirds_and_changes_the_felt_force_by_less_than_one_per_cent) {
  const auto [name, users] = GetParam();
  CoupledRun all(late_scene(name, users, 0.0)), few(late_scene(name, users, 0.1));
  ASSERT_TRUE(all.run());
  ASSERT_TRUE(few.run());
  for (std::size_t u = 0; u < few.felt.size(); ++u) {
    EXPECT_EQ(all.device_sent_ratio(u), 1.0);
    EXPECT_LT(few.device_sent_ratio(u), 1.0 / 3.0) << "user " << u;
    EXPECT_LT(force_error(few.felt[u].force, all.felt[u].force, 0.001).rms, 0.01) << "user " << u;
    EXPECT_GT(force_error(few.felt[u].on_operator, all.felt[u].on_operator, 0.001).rms, 0.0) << "every sample was sent";
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, DeadbandRun, testing::Values(std::pair{"row", 1}, std::pair{"press", 1}),
                         [](const auto& one) { return std::string(one.param.first); });

}  // namespace
}  // namespace subworld
