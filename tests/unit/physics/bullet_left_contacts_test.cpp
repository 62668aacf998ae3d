// Bodies that leave and return to the same place continue with their contact impulses.
#include "physics/engine.hpp"
#include "support/bodies.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <vector>

namespace subworld {
namespace {

constexpr double kStep_s = 0.004;

/// A stack that has stood for 2 s, with gravity tilted along a slope.
class WokenStack : public testing::TestWithParam<test::Tested> {
 protected:
  static constexpr int kCubes = 2;
  static constexpr double kSlope = 0.05;

  WokenStack() {
    EngineSettings settings = GetParam().settings();
    settings.gravity = test::kG * Vec3(kSlope, kSlope, -1.0);
    for (std::unique_ptr<Engine>* one : {&engine, &other_engine}) {
      *one = make_engine(settings, {});
      (*one)->add(test::floor_plane(BodyId{0}), BodyState{});
    }
    for (const BodyId id : cubes()) engine->add(test::cube(id), test::at(0, 0, 0.1 * index(id) - 0.05));
    test::run(*engine, 500, kStep_s);
    for (const BodyId id : cubes()) {
      slept.push_back(engine->state(id));
      slept.back().linear_velocity = slept.back().angular_velocity = Vec3::Zero();
    }
    engine->remove_all(cubes());
    engine->step(kStep_s);
  }
  static std::vector<BodyId> cubes() {
    std::vector<BodyId> ids;
    for (std::uint32_t k = 1; k <= kCubes; ++k) ids.push_back(BodyId{k});
    return ids;
  }
  /// The largest speed along and across the slope in the first steps after the cubes have returned, m/s.
  [[nodiscard]] static Vec3 jolt(Engine& engine, const std::vector<BodyState>& states) {
    for (const BodyId id : cubes()) engine.add(test::cube(id), states[index(id) - 1]);
    Vec3 fastest = Vec3::Zero();
    for (int i = 0; i < 5; ++i) {
      engine.step(kStep_s);
      for (const BodyId id : cubes()) fastest = fastest.cwiseMax(engine.state(id).linear_velocity.cwiseAbs());
    }
    return fastest;
  }

  std::unique_ptr<Engine> engine, other_engine;  ///< other_engine has never contained the stack
  std::vector<BodyState> slept;
};

TEST_P(WokenStack, StandsOnTheImpulsesWithWhichItFellAsleep) {
  const Vec3 with = jolt(*engine, slept), without = jolt(*other_engine, slept);
  for (const int across : {0, 1}) EXPECT_LT(with[across], 0.1 * without[across]) << across;
  EXPECT_LT(with.z(), 0.3 * without.z());
}

TEST_P(WokenStack, StartsFromZeroElsewhere) {
  for (BodyState& state : slept) state.position.y() += 1e-4;
  const Vec3 with = jolt(*engine, slept), without = jolt(*other_engine, slept);
  EXPECT_NEAR(with.z(), without.z(), 0.05 * without.z());
}

INSTANTIATE_TEST_SUITE_P(Bullet, WokenStack,
                         testing::Values(test::Tested{"bullet", "fast", kStep_s},
                                         test::Tested{"bullet", "quality", kStep_s},
                                         test::Tested{"bullet_float", "fast", kStep_s}),
                         test::name_of);

}  // namespace
}  // namespace subworld
