// A scheme from outside: one folder and one row, and every user of schemes finds it.
#include "coupling/plan.hpp"
#include "examples/half_way.hpp"
#include "lab/session/coupled_run.hpp"
#include "model/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace subworld {
namespace {

Scene row_with(const std::string& scheme) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  scene.settings.users = 1;
  scene.settings.scheme = scheme;
  scene.settings.duration_s = 1.0;
  return scene;
}

class ExampleScheme : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { add_scheme(half_way::kScheme); }
};

TEST_F(ExampleScheme, RunsAndIsFeltAtTheFirstContact) {
  const Scene scene = row_with("half_way");
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  double most_n = 0.0;
  for (const Vec3& force : run.felt[0].force) most_n = std::max(most_n, force.norm());
  EXPECT_GT(most_n, 0.3);   // it pushes cubes of 0.2 kg with friction 0.5
  EXPECT_LT(most_n, 40.0);  // the device's limit
  EXPECT_NE(run.hash(), [] {
    CoupledRun other(row_with("paper"));
    other.run();
    return other.hash();
  }());
}

TEST_F(ExampleScheme, DecidesThePlanByItsProperties) {
  const Scene scene = row_with("half_way");
  EXPECT_TRUE(enabled(scene, Optimisation::impulses));
  EXPECT_FALSE(enabled(row_with("paper"), Optimisation::impulses));
}

TEST_F(ExampleScheme, IsNamedWhereAnUnknownOneIsAskedFor) {
  try {
    (void)scheme_of(row_with("exemple").settings);
    FAIL() << "an unknown scheme was found";
  } catch (const Error& wrong) {
    EXPECT_NE(std::string(wrong.what()).find("direct, paper, reduced, half_way"), std::string::npos) << wrong.what();
  }
}

}  // namespace
}  // namespace subworld
