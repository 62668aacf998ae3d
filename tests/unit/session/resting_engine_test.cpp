// Resting bodies leave their engine, and return before anything can reach them.
#include "physics/shells/resting_engine.hpp"
#include "coupling/plan.hpp"

#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "model/error.hpp"
#include "model/shapes/mass_properties.hpp"
#include "physics/shells/engine_shell.hpp"
#include "support/bodies.hpp"
#include "support/engines.hpp"
#include "support/resting_stack.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace subworld {
namespace {

TEST(BoxTree, FindsWhatALoopOverAllFinds) {
  constexpr std::uint32_t kCount = 300;
  std::mt19937 draw(7);
  const auto number = [&](double most) { return most * static_cast<double>(draw()) / 4294967295.0; };
  const auto any_box = [&] {
    const Vec3 lower(number(10), number(10), number(1));
    return Box{lower, lower + Vec3(number(1), number(1), number(1))};
  };
  BoxTree tree(kCount);
  std::vector<std::optional<Box>> all(kCount);
  for (int round = 0; round < 4000; ++round) {
    const auto item = static_cast<std::uint32_t>(draw() % kCount);
    if (all[item]) {
      tree.remove(item);
      all[item].reset();
    } else {
      all[item] = any_box();
      tree.insert(item, *all[item]);
    }
    if (round % 50 != 0) continue;
    const Box where = any_box();
    std::vector<std::uint32_t> found, expected;
    tree.find(where, [&](std::uint32_t i) { found.push_back(i); });
    for (std::uint32_t i = 0; i < kCount; ++i) {
      if (all[i] && all[i]->meets(where)) expected.push_back(i);
    }
    std::ranges::sort(found);
    ASSERT_EQ(found, expected);
  }
}

using test::kHorizon_s, test::kStep_s;
class Resting : public test::RestingStack {};

TEST_P(Resting, ARestingBodyLeavesTheEngineAndIsStillThere) {
  begin();
  run(1.0);
  EXPECT_EQ(engine->asleep_count(), 3U);
  EXPECT_FALSE(inner->contains(kUpper));
  EXPECT_TRUE(engine->contains(kUpper));
  EXPECT_NEAR(engine->state(kUpper).position.z(), 0.15, 1e-3);
  EXPECT_TRUE(engine->state(kUpper).linear_velocity.isZero());
  EXPECT_NEAR(engine->bounds(kUpper).upper.z(), 0.2, 2e-3);
  EXPECT_TRUE(engine->awake().empty());
}

TEST_P(Resting, ConnectedBodiesWakeBeforeABallReachesThem) {
  begin();
  run(1.0);
  ASSERT_TRUE(engine->asleep(kLower));
  engine->set_velocity(kBall, {-4.0, 0, 0}, Vec3::Zero());
  EXPECT_FALSE(engine->asleep(kBall)) << "by being pushed";
  while (engine->asleep(kLower)) {
    run(kStep_s);
    ASSERT_GT(engine->state(kBall).position.x(), 0.1) << "it is inside of the cube";
  }
  EXPECT_FALSE(engine->asleep(kUpper));
  run(0.2);
  EXPECT_LT(engine->state(kLower).position.x(), -0.001) << "it was hit";
}

TEST_P(Resting, AStackStandsThroughSleepAndWaking) {
  begin();
  for (int i = 0; i < 5; ++i) {
    run(0.8);
    ASSERT_TRUE(engine->asleep(kUpper)) << i;
    engine->set_state(kUpper, engine->state(kUpper));
    ASSERT_FALSE(engine->asleep(kLower));
  }
  EXPECT_NEAR(engine->state(kUpper).position.z(), 0.15, 1e-3);
  EXPECT_NEAR(engine->state(kUpper).position.x(), 0.0, 1e-3);
}

TEST_P(Resting, AFallingOrCreepingBodyStaysAwake) {
  scene.bodies[index(kUpper)].gravity = false;
  scene.initial[index(kUpper)] = test::at(0.5, 0, 1.0);
  scene.initial[index(kUpper)].linear_velocity = {1e-3, 0, 0};
  begin();
  run(2.0);
  EXPECT_FALSE(engine->asleep(kUpper));
  EXPECT_TRUE(engine->asleep(kLower));
}

TEST_P(Resting, BodiesAtRestFromTheStartWakeWithBodiesTheyTouch) {
  for (const BodyId id : {kLower, kUpper}) scene.bodies[index(id)].at_rest = true;
  begin();
  EXPECT_EQ(engine->asleep_count(), 2U);
  EXPECT_FALSE(inner->contains(kLower));
  run(0.1);
  EXPECT_EQ(engine->asleep_count(), 2U);
  engine->apply_impulse(kUpper, {0.02, 0, 0}, engine->state(kUpper).position);
  EXPECT_TRUE(inner->contains(kLower)) << "else the upper one would fall";
  run(0.3);
  EXPECT_NEAR(engine->state(kUpper).position.z(), 0.15, 2e-3);
}

// One check covers several steps: a body that is hit in the first step may hit the next one in the last step.
TEST_P(Resting, APushedBodyWakesBodiesItMayReach) {
  for (const BodyId id : {kLower, kUpper}) scene.bodies[index(id)].at_rest = true;
  scene.initial[index(kUpper)] = test::at(-0.11, 0, 0.05);  // 10 mm behind the lower cube
  scene.initial[index(kBall)] = test::at(0.12, 0, 0.05);    // 20 mm in front of it
  scene.initial[index(kBall)].linear_velocity = {-2, 0, 0};
  begin();
  engine->follow(kStep_s, kHorizon_s);
  EXPECT_FALSE(engine->asleep(kLower)) << "32 mm in the time of the look";
  EXPECT_FALSE(engine->asleep(kUpper)) << "the remaining distance, and the impact may double the speed";
}

TEST_P(Resting, ABodyThatDoesNotComeSoFarWakesNone) {
  for (const BodyId id : {kLower, kUpper}) scene.bodies[index(id)].at_rest = true;
  scene.initial[index(kUpper)] = test::at(-0.11, 0, 0.05);
  scene.initial[index(kBall)] = test::at(0.12, 0, 0.05);
  scene.initial[index(kBall)].linear_velocity = {-0.5, 0, 0};
  begin();
  engine->follow(kStep_s, kHorizon_s);
  EXPECT_EQ(engine->asleep_count(), 2U) << "8 mm";
}

TEST_P(Resting, AFallingBodyWakesBodiesBelow) {
  scene.bodies[index(kLower)].at_rest = true;
  scene.initial[index(kUpper)] = test::at(0, 0, 0.151);
  begin();
  engine->follow(kStep_s, kHorizon_s);
  EXPECT_FALSE(engine->asleep(kLower)) << "g t^2 / 2 is 1.3 mm";
}

TEST_P(Resting, AnOperatorMayAccelerateWithFiveG) {
  for (const BodyId id : {kLower, kUpper}) scene.bodies[index(id)].at_rest = true;
  scene.bodies[index(kBall)].gravity = false;
  const std::vector<BodyId> tool{kBall};
  for (const auto& [gap_m, wakes] : {std::pair{0.005, true}, std::pair{0.010, false}}) {
    scene.initial[index(kBall)] = test::at(0.1 + gap_m, 0, 0.05);
    begin(true, tool);
    engine->follow(kStep_s, kHorizon_s);
    EXPECT_EQ(!engine->asleep(kLower), wakes) << gap_m << " m, of 6.4 mm";
  }
}

TEST_P(Resting, OneThatCreepsKeepsAwakeWhatItTouches) {
  for (const BodyId id : {kLower, kUpper}) scene.bodies[index(id)].material.friction = 0.0;
  for (const BodyId creeping : {kLower, kUpper}) {
    for (const BodyId id : {kLower, kUpper})
      scene.initial[index(id)].linear_velocity = {id == creeping ? 2e-3 : 0.0, 0, 0};
    begin();
    run(1.5);
    EXPECT_FALSE(engine->asleep(kUpper)) << index(creeping);
    EXPECT_FALSE(engine->asleep(kLower)) << index(creeping);
  }
}

TEST_P(Resting, ABodyRemovedInItsSleepIsGone) {
  begin();
  run(1.0);
  ASSERT_TRUE(engine->asleep(kUpper));
  engine->remove(kUpper);
  EXPECT_FALSE(engine->contains(kUpper));
  run(0.1);
  EXPECT_EQ(std::ranges::count(engine->awake(), kUpper), 0);
  EXPECT_NEAR(engine->state(kLower).position.z(), 0.05, 1e-3);
}

TEST_P(Resting, HasNoCheckpoints) {
  begin();
  EXPECT_EQ(engine->capabilities().checkpoint, Fidelity::absent);
  EXPECT_THROW((void)engine->checkpoint(), Error);
}

TEST_P(Resting, NothingSleepsWithRestDisabled) {
  begin(false);
  run(1.0);
  EXPECT_EQ(engine->asleep_count(), 0U);
  EXPECT_EQ(engine->awake().size(), 3U);
}

INSTANTIATE_TEST_SUITE_P(Engines, Resting, testing::ValuesIn(test::tested_engines({kStep_s}, {kStep_s})),
                         test::name_of);

// Before the tool arrives, a row costs nothing. Then the felt force is that of a row that never slept, except for the
// effect of the solver's first guess: less than that of half the step.
TEST(RestingWorld, ARowThatSleptIsFeltAsOneThatDidNot) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  keep_users(scene, 1);
  CoupledRun asleep(scene);
  asleep.cycle();
  EXPECT_EQ(asleep.world.engine().asleep_count(), 10U);
  ASSERT_TRUE(asleep.run());
  scene.settings.disable(kDisableAll);
  CoupledRun awake(scene);
  ASSERT_TRUE(awake.run());
  EXPECT_EQ(awake.world.engine().asleep_count(), 0U);
  EXPECT_LT(force_error(asleep.felt[0].force, awake.felt[0].force, scene.settings.h_s).rms, 0.005);
}

/// `row` after a few cycles, asleep.
class SleepingRow : public ::testing::Test {
 protected:
  static Scene row() {
    Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
    keep_users(scene, 1);
    return scene;
  }
  void SetUp() override {
    const std::string folders = std::string(EXAMPLE_ENGINES_FOLDER) + ":" + ENGINES_FOLDER;
    setenv("SUBWORLD_ENGINES", folders.c_str(), 1);
    for (int i = 0; i < 5; ++i) run.cycle();
    ASSERT_EQ(run.world.engine().asleep_count(), 10U);
  }

  Scene scene = row();
  CoupledRun run{scene};
  EngineExchange exchange{EngineExchange::Preparation::at_once, {}};
};

TEST_F(SleepingRow, IsHandedToAnotherEngineToo) {
  run.world.change_engine(exchange, {EngineOrder::Target::world, "ode", "fast"});
  while (!run.world.exchange_engine(exchange)) run.cycle();
  ASSERT_TRUE(run.run());
  EXPECT_EQ(run.world.engine().name(), "ode");
  double most = 0.0;
  for (const Vec3& f : run.felt[0].force) most = std::max(most, std::abs(f.x()));
  EXPECT_GT(most, 0.8 * 10 * 0.5 * 0.2 * 9.81) << "mu m g of all ten";
}

TEST_F(SleepingRow, RefusesAnEngineThatCannotHoldIt) {
  run.world.change_engine(exchange, {EngineOrder::Target::world, "spheres", "fast"});
  EXPECT_FALSE(run.world.exchange_engine(exchange));
  EXPECT_FALSE(exchange.take_failure().empty()) << "else the run would end when the row wakes";
  ASSERT_TRUE(run.run());
  EXPECT_EQ(run.world.engine().name(), "bullet");
}

TEST_F(SleepingRow, SleepsOnWhereAnUnknownEngineOrPresetIsOrdered) {
  for (const EngineOrder& order : {EngineOrder{EngineOrder::Target::world, "havoc", "fast"},
                                   EngineOrder{EngineOrder::Target::world, "ode", "best"}}) {
    EXPECT_EQ(run.world.change_engine(exchange, order).outcome, OrderState::refused) << order.engine;
    EXPECT_EQ(run.world.engine().asleep_count(), 10U) << order.engine;
  }
}

// The last correction of a body that has fallen asleep since wakes no body.
TEST_F(SleepingRow, SleepsAgainWhenTheOperatorHasGone) {
  while (run.world.facts().time_s < 2.0) run.cycle();
  ASSERT_EQ(run.world.engine().asleep_count(), 0U) << "it is pushed";
  while (run.world.facts().time_s < 4.0 && run.world.engine().asleep_count() < 10) run.cycle();
  for (int i = 0; i < 100; ++i) {
    run.cycle();
    ASSERT_EQ(run.world.engine().asleep_count(), 10U) << i;
  }
}

// A sleeping body retains its energy: leaving and returning must not count as work.
TEST_F(SleepingRow, KeepsTheEnergyOfTheWorld) {
  Scene awake = scene;
  awake.settings.disable(kDisableAll);
  CoupledRun other(awake);
  for (int i = 0; i < 5; ++i) other.cycle();
  EXPECT_NEAR(run.world.facts().potential_j, other.world.facts().potential_j, 1e-3);
  ASSERT_TRUE(run.run());
  ASSERT_TRUE(other.run());
  EXPECT_NEAR(run.world.facts().potential_j, other.world.facts().potential_j, 1e-3);
  EXPECT_LT(run.world.facts().energy_excess_j, 1e-3);
}

/// A scene that changes while it runs, with all optimisations on and off.
class PlanOfAChangingScene : public ::testing::Test {
 protected:
  void SetUp() override { setenv("SUBWORLD_ENGINES", ENGINES_FOLDER, 1); }

  /// RMS difference of the felt forces. `change` is called before every cycle.
  double difference(
      Disabled all = kDisableAll, const std::function<void(CoupledRun&)>& change = [](CoupledRun&) {}) const {
    std::vector<std::vector<Vec3>> felt;
    for (const Disabled kept : {kDisableNothing, all}) {
      Scene one = scene;
      one.settings.disable(kept);
      CoupledRun run(one);
      while (run.finite() && run.world.facts().time_s < one.settings.duration_s) {
        change(run);
        run.cycle();
      }
      EXPECT_TRUE(run.finite());
      felt.push_back(std::move(run.felt[0].force));
    }
    return force_error(felt[0], felt[1], scene.settings.h_s).rms;
  }
  /// Flies along x and hits the row's far end while the operator pushes.
  void shoot_a_ball(double friction) {
    test::throw_ball(scene, {5.0, 0.0, 0.05}, {-3.0, 0.0, 0.0}).material.friction = friction;
  }

  Scene scene = [] {
    Scene row = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
    keep_users(row, 1);
    return row;
  }();
};

TEST_F(PlanOfAChangingScene, ABodyIsShotIntoRestingBodies) {
  shoot_a_ball(0.5);
  EXPECT_LT(difference(), 0.02);
}

TEST_F(PlanOfAChangingScene, TheFirstBodyWithFrictionComes) {
  for (Body& body : scene.bodies) body.material.friction = body.name == "floor" ? 0.5 : 0.0;
  shoot_a_ball(0.5);
  EXPECT_TRUE(enabled(scene, Optimisation::friction));
  EXPECT_EQ(difference(disabled(Optimisation::friction)), 0.0);
}

// Bodies that sleep and wake enter the new engine in another order, which changes the solver's result by a percent. Of
// mu m g of the ten cubes, 9.81 N, one run feels 9.72 N and the other 9.86 N.
TEST_F(PlanOfAChangingScene, TheWorldGetsAnotherEngineWhileItRests) {
  EngineExchange exchange{EngineExchange::Preparation::at_once, {}};
  const CoupledRun* of = nullptr;
  EXPECT_LT(difference(kDisableAll,
                       [&](CoupledRun& run) {
                         if (&run != of && run.world.facts().time_s > 0.1) {
                           of = &run;
                           run.world.change_engine(exchange, {EngineOrder::Target::world, "bullet_float", "fast"});
                         }
                         (void)run.world.exchange_engine(exchange);
                       }),
            0.05);
}

/// Claims to estimate friction, and counts the estimates.
class EstimatingEngine final : public EngineShell {
 public:
  EstimatingEngine(std::unique_ptr<Engine> inner, int& estimates) : inner_(std::move(inner)), estimates_(estimates) {}
  Capabilities capabilities() const noexcept override {
    Capabilities can = EngineShell::capabilities();
    can.tangential_impulse = Fidelity::estimated;
    return can;
  }
  std::span<const Contact> contacts_with_friction() override {
    ++estimates_;
    return EngineShell::contacts_with_friction();
  }

 private:
  Engine& inner() const noexcept override { return *inner_; }
  std::unique_ptr<Engine> inner_;
  int& estimates_;
};

TEST_F(PlanOfAChangingScene, FrictionIsEstimatedOnlyWhileABorderReadsIt) {
  for (const Disabled disabled : {kDisableNothing, disabled(Optimisation::impulses)}) {
    scene.settings.disable(disabled);
    int estimates = 0;
    CoupledRun run(scene, [&](const EngineSettings& settings, std::span<const Mesh> meshes) {
      return std::make_unique<EstimatingEngine>(make_engine(settings, meshes), estimates);
    });
    const auto estimates_in = [&](int cycles) {
      estimates = 0;
      for (int i = 0; i < cycles; ++i) run.cycle();
      return estimates;
    };
    EXPECT_EQ(estimates_in(26), disabled == kDisableNothing ? 0 : 25) << "the operator is in free space";
    while (run.world.facts().time_s < 1.5) run.cycle();
    EXPECT_EQ(estimates_in(25), 25) << "it pushes";
  }
}

}  // namespace
}  // namespace subworld
