// Oscillating structures that no operator reaches are damped, and sleep.
#include "lab/session/coupled_run.hpp"
#include "physics/shells/engine_shell.hpp"
#include "physics/shells/resting_engine.hpp"
#include "support/bodies.hpp"
#include "support/engines.hpp"
#include "support/resting_stack.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

namespace subworld {
namespace {

using test::kHorizon_s, test::kStep_s;

/// Records which bodies get a velocity, and its value.
class Watched final : public EngineShell {
 public:
  explicit Watched(Engine& inner) : inner_(inner) {}
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    damped.push_back(id);
    const double before_m_s = inner_.state(id).linear_velocity.norm();
    if (before_m_s > 1e-9) most_left = std::max(most_left, linear.norm() / before_m_s);
    return inner_.set_velocity(id, linear, angular);
  }
  std::vector<BodyId> damped;
  double most_left = 0.0;  ///< of a velocity

 private:
  Engine& inner() const noexcept override { return inner_; }
  Engine& inner_;
};

/// Trembles by 0.8 % of a cube's size, like a solver with a persistent error.
class Trembling final : public EngineShell {
 public:
  explicit Trembling(Engine& inner) : inner_(inner) {}
  BodyState state(BodyId id) const override {
    BodyState now = inner_.state(id);
    if (id == BodyId{2}) now.position.x() += (++asked_ / 4 % 2 == 0 ? 4e-4 : -4e-4);
    return now;
  }

 private:
  Engine& inner() const noexcept override { return inner_; }
  Engine& inner_;
  mutable int asked_ = 0;
};

/// Lets twelve cubes creep by 2.2 % of their size each `period_s`, one after the other.
class Creeping final : public EngineShell {
 public:
  static constexpr std::uint32_t kFirst = 4, kCount = 12;
  static constexpr double kStride_m = 2.2e-3;

  Creeping(Engine& inner, double period_s) : inner_(inner), period_s_(period_s) {}
  void stepped(double dt) override { time_s_ += dt; }
  BodyState state(BodyId id) const override {
    BodyState now = inner_.state(id);
    const std::uint32_t turn = index(id) - kFirst;
    if (turn < kCount) now.position.x() += kStride_m * std::floor(time_s_ / period_s_ + double(turn) / kCount);
    return now;
  }

 private:
  Engine& inner() const noexcept override { return inner_; }
  Engine& inner_;
  double period_s_;
  double time_s_ = 0.0;
};

class SettlingStack : public test::RestingStack {
 protected:
  void settle_in(Engine& shown, std::span<const BodyId> restless = {}, bool asked = true) {
    engine = std::make_unique<RestingEngine>(shown, scene, restless, true, asked);
    for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
  }
  /// Whether the stack's upper cube has settled within `seconds`, with an operator at `tool_x_m`.
  bool settles(double seconds, double tool_x_m, bool asked = true) {
    const Body tool = test::ball_proxy(BodyId{4}, 0.03, 0.1);
    add(tool, test::at(tool_x_m, 0, 0.25));
    scene.initial[index(kBall)] = test::at(0.11, -0.25, 0.05);  // passes by, so that the stack stays awake
    scene.initial[index(kBall)].linear_velocity.y() = 1.0;
    const std::vector<BodyId> restless{tool.id};
    inner = GetParam().make();
    Trembling trembling(*inner);
    Watched watched(trembling);
    settle_in(watched, restless, asked);
    run(seconds);
    EXPECT_FALSE(std::ranges::count(watched.damped, kBall)) << "it rolls";
    EXPECT_FALSE(std::ranges::count(watched.damped, tool.id));
    const bool settled = std::ranges::count(watched.damped, kUpper) > 0;
    EXPECT_TRUE(settled || std::ranges::count(watched.damped, kLower) == 0) << "they hang together";
    EXPECT_LE(watched.most_left, std::exp(-Settling::kSettling_per_s * kStep_s) + 1e-9);
    engine.reset();
    return settled;
  }
};

TEST_P(SettlingStack, AStructureThatNoOperatorReaches) { EXPECT_TRUE(settles(0.5, 3.0)); }
TEST_P(SettlingStack, NotBeforeItHasBeenCalm) { EXPECT_FALSE(settles(0.2, 3.0)); }
TEST_P(SettlingStack, NotWhereAnOperatorReachesIt) { EXPECT_FALSE(settles(0.5, 0.1)); }
TEST_P(SettlingStack, NotWithSwayDisabled) { EXPECT_FALSE(settles(0.5, 3.0, false)); }
TEST_P(SettlingStack, NotSlidingBodies) {
  scene.bodies[index(kUpper)].material.friction = 0.0;
  EXPECT_FALSE(settles(0.5, 3.0));
}
TEST_P(SettlingStack, NotFallingBodies) {
  for (const BodyId id : {kLower, kUpper}) scene.initial[index(id)].position.z() += 5.0;
  EXPECT_FALSE(settles(0.5, 3.0));
}

TEST_P(SettlingStack, ALongSettledStructureSleepsThoughItTrembles) {
  inner = GetParam().make();
  Trembling trembling(*inner);
  settle_in(trembling);
  run(4.5);
  EXPECT_FALSE(engine->asleep(kUpper));
  EXPECT_FALSE(engine->asleep(kLower)) << "the body that it touches trembles";
  run(1.5);
  EXPECT_TRUE(engine->asleep(kUpper));
  engine->set_velocity(kUpper, {0.01, 0, 0}, Vec3::Zero());
  run(1.0);
  EXPECT_FALSE(engine->asleep(kUpper)) << "a body that is moved from outside settles again";
  engine.reset();
}

TEST_P(SettlingStack, AnOperatorNearbyRestartsSettling) {
  const Body tool = test::ball_proxy(BodyId{4}, 0.03, 0.1);
  add(tool, test::at(3.0, 0, 0.25));
  const std::vector<BodyId> restless{tool.id};
  inner = GetParam().make();
  Trembling trembling(*inner);
  settle_in(trembling, restless);
  run(4.0);
  engine->set_state(tool.id, test::at(0.1, 0, 0.25));
  run(0.2);
  engine->set_state(tool.id, test::at(3.0, 0, 0.25));
  run(3.0);
  EXPECT_FALSE(engine->asleep(kUpper));
  run(4.0);
  EXPECT_TRUE(engine->asleep(kUpper));
  engine.reset();
}

// Twelve cubes under one plank, of which one has always moved within the time for which bodies must be still.
TEST_P(SettlingStack, ALongSettledStructureSleepsThoughItCreeps) {
  for (std::uint32_t i = 0; i < Creeping::kCount; ++i) {
    add(test::cube(BodyId{Creeping::kFirst + i}), test::at(0.15 * i, 1, 0.05));
  }
  const BodyId plank{Creeping::kFirst + Creeping::kCount};
  Body long_box = test::cube(plank);
  long_box.shape.half_extents.x() = 1.0;
  long_box.rotates = false;
  add(long_box, test::at(0.825, 1, 0.15));
  for (const double period_s : {1.1 * Settling::kCreep_s, 0.9 * Settling::kCreep_s}) {
    inner = GetParam().make();
    Creeping creeping(*inner, period_s);
    settle_in(creeping);
    run(4.5);
    EXPECT_FALSE(engine->asleep(plank));
    run(3.5);
    EXPECT_EQ(engine->asleep(plank), period_s > Settling::kCreep_s) << period_s << " s a stride";
    engine.reset();
  }
}

// Steeper than the friction angle by 0.8 degrees: with damping, it would slide at 0.04 m/s without end.
TEST(Sliding, GetsAway) {
  constexpr double kNet_m_s2 = 0.15, kFriction = 0.5, kG = 9.81;
  const double angle = std::atan(kFriction) + std::asin(kNet_m_s2 / kG / std::sqrt(1.0 + kFriction * kFriction));
  constexpr BodyId kCube{1};
  Scene scene;
  scene.bodies = {test::floor_plane(BodyId{0}), test::cube(kCube)};
  for (Body& body : scene.bodies) body.material.friction = kFriction;
  scene.initial = {BodyState{}, test::at(0, 0, 0.05)};
  EngineSettings& settings = scene.settings.world;
  settings.gravity = kG * Vec3(std::sin(angle), 0, -std::cos(angle));
  const auto inner = make_engine(settings, {});
  RestingEngine engine(*inner, scene, {}, true, true);
  for (const Body& body : scene.bodies) engine.add(body, scene.initial[index(body.id)]);
  for (double t = 0.0; t < 6.0; t += kStep_s) {
    engine.follow(kStep_s, kHorizon_s);
    engine.step(kStep_s);
  }
  EXPECT_GT(engine.state(kCube).linear_velocity.x(), 0.3) << "of 0.9 m/s without damping";
}

// Sixteen columns that lean on each other and on the walls, stepped as coarsely as `basin`.
TEST(Pile, SleepsAsAWhole) {
  Scene scene = load_text(R"(name: pile
settings:
  h_s: 0.001
  ratio: 16
  settle: {duration_s: 0}
  world: {engine: bullet, preset: fast}
  haptic: {engine: bullet, preset: fast}
materials:
  plain: {friction: 0.5, restitution: 0}
bodies:
  - {name: floor, shape: plane, fixed: true, material: plain}
  - {name: basin, shape: bin, size_m: [6, 6, 40], wall_m: 2, fixed: true, material: plain}
  - name: cube
    shape: box
    size_m: [1, 1, 1]
    mass_kg: 1000
    material: plain
    position_m: [0, 0, 0.5]
    repeat: {heap: {count: 128, area_m: [6, 6], seed: 1, max_tilt_deg: 10}}
users:
  - name: watcher
    proxy:
      shape: sphere
      radius_m: 0.03
      mass_kg: 0.1
      position_m: [-16, 0, 0.5]
      rotates: false
      gravity: false
      material: plain
    coupling: {stiffness_n_m: 1000, damping_n_s_m: 20}
    box_half_m: 0.2
    device: {force_limit_n: 40}
)");
  const auto asleep_after = [&](double seconds) {
    CoupledRun run(scene);
    while (run.world.facts().time_s < seconds) run.cycle();
    return run.world.engine().asleep_count();
  };
  EXPECT_EQ(asleep_after(25.0), 128U);
  scene.settings.disable(disabled(Optimisation::sway));
  EXPECT_LT(asleep_after(25.0), 128U) << "with sway disabled, it oscillates";
}

test::Halves<test::Tested> settling_grid() {
  return test::quarter(test::halves(test::tested_engines({kStep_s}, {kStep_s}), 2));
}
INSTANTIATE_TEST_SUITE_P(Engines, SettlingStack, testing::ValuesIn(settling_grid().half), test::name_of);
INSTANTIATE_TEST_SUITE_P(Full, SettlingStack, testing::ValuesIn(settling_grid().other), test::name_of);

}  // namespace
}  // namespace subworld
