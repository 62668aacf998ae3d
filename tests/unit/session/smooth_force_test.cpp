// The felt force where world and sub-world always differ a little: corrections in several steps, and heaps between two
// engines.
#include "coupling/sync/gradual_shifts.hpp"
#include "lab/session/coupled_run.hpp"
#include "support/bodies.hpp"
#include "support/grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace subworld {
namespace {

constexpr BodyId kCube{0};

struct Shifted : testing::Test {
  Shifted() { engine->add(test::cube(kCube, 0.1, 1.0), {}); }
  [[nodiscard]] double x() const { return engine->state(kCube).position.x(); }

  static EngineSettings weightless() {
    EngineSettings settings;
    settings.name = "bullet";
    settings.gravity = Vec3::Zero();
    return settings;
  }

  std::unique_ptr<Engine> engine = make_engine(weightless(), {});
  GradualShifts gradual;
  Shift shift{.position = Vec3(4e-3, 0, 0)};
};

TEST_F(Shifted, ABodyMovesByEqualSharesOneBeforeEachStep) {
  gradual.begin(*engine, kCube, engine->state(kCube), shift, 4);
  for (int part = 1; part <= 6; ++part) {
    gradual.step(*engine);
    EXPECT_NEAR(x(), 1e-3 * std::min(part, 4), 1e-9);
    EXPECT_NEAR(gradual.completed(kCube, engine->state(kCube)).position.x(), 4e-3, 1e-9);
    engine->step(0.001);
  }
}

TEST_F(Shifted, AShiftInOneStepIsMadeAtOnce) {
  gradual.begin(*engine, kCube, engine->state(kCube), shift, 1);
  EXPECT_NEAR(x(), 4e-3, 1e-9);
  gradual.step(*engine);
  EXPECT_NEAR(x(), 4e-3, 1e-9);
}

TEST_F(Shifted, ASecondShiftComesOnTopAndABodyThatGoesIsForgotten) {
  gradual.begin(*engine, kCube, engine->state(kCube), shift, 4);
  gradual.begin(*engine, kCube, engine->state(kCube), shift, 2);
  EXPECT_NEAR(x(), 3e-3, 1e-9);
  EXPECT_NEAR(gradual.completed(kCube, engine->state(kCube)).position.x(), 8e-3, 1e-9);
  gradual.forget(kCube);
  engine->remove(kCube);
  gradual.step(*engine);  // would throw
}

/// Bullet at 4 ms lets the cubes of a heap overlap by half a millimetre, stiffer engines by micrometres. With immediate
/// corrections, and with walls that hold any load, the operator felt steps of up to 37 N here.
struct OperatorInHeap : testing::TestWithParam<std::string> {};

TEST_P(OperatorInHeap, FeelsNoJoltBetweenTwoEngines) {
  constexpr double kFromTouch_s = 0.3;
  constexpr double kJolt_n = 8.0;
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/heap_press.yaml");
  scene.settings.haptic.name = GetParam();
  scene.settings.haptic.iterations.reset();
  scene.settings.users = 1;
  keep_users(scene, 1);
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  const std::vector<Vec3>& force = run.felt[0].force;
  double largest_n = 0.0;
  for (std::size_t n = static_cast<std::size_t>(kFromTouch_s / scene.settings.h_s); n + 1 < force.size(); ++n) {
    largest_n = std::max(largest_n, (force[n + 1] - force[n]).norm());
  }
  EXPECT_GT(force.back().norm(), 0.0);

  EXPECT_LT(largest_n, kJolt_n);
}

/// The world's engine is Bullet: the others, in turn.
test::Halves<std::string> haptic_engines() { return test::quarter(test::halves(engine_names(), 1)); }
INSTANTIATE_TEST_SUITE_P(Engines, OperatorInHeap, testing::ValuesIn(haptic_engines().half),
                         [](const auto& engine) { return engine.param; });
INSTANTIATE_TEST_SUITE_P(Full, OperatorInHeap, testing::ValuesIn(haptic_engines().other),
                         [](const auto& engine) { return engine.param; });

}  // namespace
}  // namespace subworld
