// A running world or sub-world changes its engine without a jump of the force.
#include "physics/shells/engine_exchange.hpp"
#include "lab/session/coupled_run.hpp"
#include "model/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace subworld {
namespace {

/// Single precision at a scene's size: error of a pose that passes between two engines.
constexpr double kPrecision = 1e-6;

double apart(const BodyState& a, const BodyState& b) {
  return std::max({(a.position - b.position).norm(), a.orientation.angularDistance(b.orientation),
                   (a.linear_velocity - b.linear_velocity).norm(), (a.angular_velocity - b.angular_velocity).norm()});
}

class Pairs : public testing::TestWithParam<std::tuple<std::string, std::string>> {
 protected:
  std::string from = std::get<0>(GetParam());
  std::string to = std::get<1>(GetParam());
};

TEST_P(Pairs, BodiesKeepPoseVelocityAndInertia) {
  const Scene scene = load_scene(SCENES_FOLDER "/row.yaml");
  EngineSettings settings = scene.settings.world;
  settings.name = from;
  LiveEngine engine(make_engine(settings, scene.meshes));
  for (const Body& body : scene.bodies) engine.add(body, scene.initial[index(body.id)]);
  for (int i = 0; i < 100; ++i) engine.step(0.001);

  settings.name = to;
  PreparedEngine prepared = prepare_engine(settings, scene.meshes, engine.content(), 0.001);
  // Meanwhile one body is removed, one added, one pushed, and one gets heavier.
  const BodyId gone = scene.bodies[3].id, pushed = scene.bodies[4].id, heavy = scene.bodies[5].id;
  engine.remove(gone);
  engine.set_velocity(pushed, {0.1, 0.2, 0.3}, {1, 2, 3});
  engine.set_inertia(heavy, 7.0, {1, 1, 1});
  Body late = scene.bodies[3];
  late.id = BodyId{static_cast<std::uint32_t>(scene.bodies.size())};
  BodyState high = scene.initial[3];
  high.position.z() += 3.0;
  engine.add(late, high);
  std::vector<HeldBody> before = engine.content();

  const std::unique_ptr<Engine> old = engine.exchange(std::move(prepared));
  EXPECT_EQ(old->name(), from);
  EXPECT_EQ(engine.name(), to);
  EXPECT_FALSE(engine.contains(gone));
  ASSERT_EQ(engine.content().size(), before.size());
  for (const HeldBody& held : before) {
    EXPECT_LT(apart(engine.state(held.body.id), held.state), kPrecision) << index(held.body.id);
  }
  engine.apply_impulse(heavy, {0, 0, 7.0}, engine.state(heavy).position);
  EXPECT_NEAR(engine.state(heavy).linear_velocity.z() - before[5].state.linear_velocity.z(), 1.0, 1e-3);
}

TEST_P(Pairs, ThePressingOperatorFeelsNoJump) {
  Scene scene = load_scene(SCENES_FOLDER "/press.yaml");
  scene.settings.scheme = "reduced";
  scene.settings.users = 1;
  scene.settings.haptic.name = from;
  scene.settings.world.name = from;
  scene.settings.duration_s = 1.1;
  CoupledRun run(scene);
  EngineExchange world_exchange(EngineExchange::Preparation::at_once, scene.meshes);
  EngineExchange haptic_exchange(EngineExchange::Preparation::at_once, scene.meshes);
  std::size_t changed_at = 0;
  while (!run.world.facts().over) {
    run.cycle();
    ASSERT_TRUE(run.finite()) << run.world.facts().time_s;
    if (changed_at > 0 || run.world.facts().time_s < 0.9) continue;  // the cube is pressed against the wall
    changed_at = run.felt[0].force.size();
    run.subs[0]->change_engine(haptic_exchange, {EngineOrder::Target::haptic, to, "fast"});
    ASSERT_TRUE(run.subs[0]->exchange_engine(haptic_exchange)) << haptic_exchange.take_failure();
    run.world.change_engine(world_exchange, {EngineOrder::Target::world, to, "fast"});
    ASSERT_TRUE(run.world.exchange_engine(world_exchange)) << world_exchange.take_failure();
  }
  ASSERT_GT(changed_at, 0U);
  const std::vector<Vec3>& force = run.felt[0].on_operator;
  ASSERT_GT(force[changed_at - 1].norm(), 5.0) << "nothing was pressed";
  // After that the new engine alone determines the motion.
  constexpr std::size_t kSteps = 100;
  for (std::size_t i = changed_at; i < std::min(force.size(), changed_at + kSteps); ++i) {
    EXPECT_LT((force[i] - force[i - 1]).norm(), 0.3) << "step " << i - changed_at << " after the change";
  }
}

std::string pair_name(const testing::TestParamInfo<Pairs::ParamType>& info) {
  return std::get<0>(info.param) + "_to_" + std::get<1>(info.param);
}
INSTANTIATE_TEST_SUITE_P(Engines, Pairs,
                         testing::Combine(testing::ValuesIn(engine_names()), testing::ValuesIn(engine_names())),
                         pair_name);

TEST(EngineExchange, AnEngineThatIsNotThereLeavesTheOldOneRunning) {
  for (const auto preparation : {EngineExchange::Preparation::at_once, EngineExchange::Preparation::in_background}) {
    LiveEngine engine(make_engine({}, {}));
    EngineExchange exchange(preparation, {});
    EngineSettings settings;
    settings.name = "none_such";
    ASSERT_TRUE(exchange.begin(settings, engine, 0.001));
    std::string failure;
    while (failure.empty()) {
      EXPECT_FALSE(exchange.poll(engine));
      failure = exchange.take_failure();
    }
    EXPECT_NE(failure.find("none_such"), std::string::npos);
    EXPECT_EQ(engine.name(), "bullet");
    settings.name = "bullet_float";  // and the next order is executed
    ASSERT_TRUE(exchange.begin(settings, engine, 0.001));
    EXPECT_FALSE(exchange.begin(settings, engine, 0.001) && preparation == EngineExchange::Preparation::at_once);
    while (!exchange.poll(engine)) {
    }
    EXPECT_EQ(engine.name(), "bullet_float");
  }
}

TEST(EngineOrder, TextAndBack) {
  const auto order =
      parse_engine_order({.number = 7, .argument = to_text({EngineOrder::Target::haptic, "havok", "quality"})});
  ASSERT_TRUE(order);
  EXPECT_EQ(order->target, EngineOrder::Target::haptic);
  EXPECT_EQ(order->engine, "havok");
  EXPECT_EQ(order->preset, "quality");
  EXPECT_EQ(order->number, 7U);
  for (const char* wrong : {"", "world", "moon bullet fast", "world bullet", "world bullet fast more"}) {
    EXPECT_FALSE(parse_engine_order({.argument = wrong})) << wrong;
  }
}

}  // namespace
}  // namespace subworld
