// A changing simulation ratio: the counting of steps, the decision, and the felt force.
#include "coupling/messages/ratio_control.hpp"
#include "coupling/messages/timetable.hpp"
#include "coupling/schemes/paper/paper.hpp"
#include "lab/session/coupled_run.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {
namespace {

TEST(Timetable, CountsStepsThroughChanges) {
  Timetable table(4, 16);
  table.plan({10, 6});
  table.plan({12, 5});
  EXPECT_EQ(table.start(10), 40U);
  EXPECT_EQ(table.ratio(9), 4);
  EXPECT_EQ(table.ratio(10), 6);
  EXPECT_EQ(table.start(12), 52U);
  EXPECT_EQ(table.start(15), 67U);
}

TEST(Timetable, KnowsEachChangeOnceAndInOrder) {
  Timetable table(4, 16);
  table.plan({10, 6});
  table.plan({10, 6});
  table.plan({8, 20});
  EXPECT_EQ(table.start(20), 100U);
  EXPECT_EQ(table.newest().stamp, 10U);
}

TEST(Timetable, RemembersAsFarBackAsAsked) {
  constexpr std::uint64_t kRemembered = 16;
  Timetable table(4, kRemembered);
  std::vector<std::uint64_t> starts;
  std::uint64_t start = 0;
  for (std::uint64_t stamp = 0; stamp < 500; ++stamp) {
    const int ratio = 2 + static_cast<int>(stamp / 3 % 7);
    table.plan({stamp, ratio});
    starts.push_back(start);
    start += static_cast<std::uint64_t>(table.ratio(stamp));
    for (std::uint64_t j = stamp - std::min(stamp, kRemembered); j <= stamp; ++j) ASSERT_EQ(table.start(j), starts[j]);
  }
}

TEST(Timetable, RestartsInTheMiddle) {
  Timetable table(4, 16);
  table.restart(100, 470, 7);
  EXPECT_EQ(table.start(100), 470U);
  EXPECT_EQ(table.start(102), 484U);
  EXPECT_EQ(table.start(99), 463U);
}

Settings adaptive(int least, int most) {
  Settings settings;
  settings.set_ratio({least, most});
  return settings;
}

/// The ratio after `cycles` of a world whose step has this cost.
int after(RatioControl& control, int ratio, bool felt, double step_s, int cycles) {
  const CycleCost cost = [step_s](double, int substeps) { return substeps * step_s; };
  for (int i = 0; i < cycles; ++i) ratio = control.choose_ratio(ratio, felt, 1e-3 * ratio, cost);
  return ratio;
}

TEST(RatioControl, IsTheSmallestThatTheWorldAffordsWhileABorderIsFelt) {
  RatioControl control(adaptive(4, 12));
  EXPECT_EQ(after(control, 4, true, 1e-3, 100), 4);
  const int slow = after(control, 4, true, 4.0e-3, 100);
  EXPECT_LE(4.0e-3, RatioControl::kShare * 1e-3 * slow);
  EXPECT_GT(4.0e-3, RatioControl::kShare * 1e-3 * (slow - 1));
  EXPECT_EQ(after(control, slow, true, 1e-3, 1), slow) << "not for one cheap cycle";
  EXPECT_EQ(after(control, slow, true, 1e-3, 100), 4);
  EXPECT_EQ(after(control, 4, true, 1.0, 100), 12) << "not above the bound, whatever it costs";
}

TEST(RatioControl, GrowsWithoutFeltContactForAWhile) {
  RatioControl control(adaptive(4, 12));
  const int cycles = static_cast<int>(RatioControl::kSettled_s / 4e-3);
  EXPECT_EQ(after(control, 4, false, 1e-3, cycles - 1), 4);
  EXPECT_EQ(after(control, 4, false, 1e-3, 3), 12);
  EXPECT_EQ(after(control, 12, true, 1e-3, 1), 4) << "it is felt: at once";
}

TEST(RatioControl, StaysWhereTheCostWavers) {
  RatioControl control(adaptive(4, 12));
  int ratio = after(control, 4, true, 3.6e-3, 10), changes = 0;
  for (int i = 0; i < 1000; ++i) {
    const int next = after(control, ratio, true, i % 2 == 0 ? 2.3e-3 : 3.6e-3, 1);
    changes += next != ratio;
    ratio = next;
  }
  EXPECT_EQ(changes, 0);
}

TEST(RatioControl, FixedStaysFixed) {
  RatioControl control(adaptive(4, 4));
  EXPECT_EQ(after(control, 4, false, 1.0, 1000), 4);
}

TEST(RatioControl, SubStepsAreAsRequestedAndAffordable) {
  const RatioControl control(adaptive(4, 16));
  const auto substeps = [&](int present, double step_s, double time_s = 0.016) {
    return control.choose_substeps(present, 0.016, 0.005, time_s, [step_s](double, int n) { return n * step_s; });
  };
  EXPECT_EQ(substeps(1, 0.0), 4);
  EXPECT_EQ(substeps(1, 1e-3), 4);
  EXPECT_EQ(substeps(4, 4e-3), 2);
  EXPECT_EQ(substeps(4, 0.1), 1);
  EXPECT_EQ(substeps(4, 2.8e-3), 4) << "the present ones stay a little above the share";
  EXPECT_LT(substeps(1, 2.8e-3), 4) << "and no new one is added";
  EXPECT_EQ(substeps(4, 2e-3, 0.004), 1) << "the last long cycle before short ones has the time of a short one";
}

TEST(RatioControl, SubStepsThatASceneNamesStay) {
  Settings settings = adaptive(4, 16);
  settings.world.substeps = 3;
  EXPECT_EQ(RatioControl(settings).choose_substeps(1, 0.016, 0.005, 0.016, [](double, int) { return 1.0; }), 3);
}

TEST(RatioControl, StaysWithinNewBounds) {
  RatioControl control(adaptive(4, 12));
  control.set_bounds({6, 8});
  EXPECT_EQ(after(control, 4, true, 0.1e-3, 1), 6);
  EXPECT_EQ(after(control, 12, true, 0.1e-3, 1), 8);
  EXPECT_EQ(after(control, 6, true, 100e-3, 1), 8);
  control.set_bounds({5, 5});
  EXPECT_EQ(after(control, 8, false, 0.1e-3, 1), 5);
}

Scene scene_of(const std::string& name, const RatioBounds& ratio) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.set_ratio(ratio);
  scene.settings.users = 1;
  keep_users(scene, 1);
  return scene;
}

TEST(AdaptiveRatio, RepeatsBitByBitAndIsFeltAsTheSmallestRatio) {
  const Scene scene = scene_of("row", {4, 10});
  CoupledRun once(scene), again(scene), fixed(scene_of("row", {4, 4}));
  std::vector<int> ratios;
  while (once.world.facts().time_s < 1.5) {
    once.cycle();
    again.cycle();
    ratios.push_back(once.world.facts().ratio);
  }
  while (fixed.world.facts().time_s < once.world.facts().time_s - 1e-9) fixed.cycle();
  EXPECT_EQ(once.world.facts().state_hash, again.world.facts().state_hash);
  EXPECT_EQ(std::ranges::count(ratios, 10) > 5, true) << "before the tool comes";
  EXPECT_EQ(ratios.back(), 4) << "while it pushes";
  double difference = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < std::min(once.felt[0].force.size(), fixed.felt[0].force.size()); ++i) {
    difference += (once.felt[0].force[i] - fixed.felt[0].force[i]).squaredNorm();
    squares += fixed.felt[0].force[i].squaredNorm();
  }
  EXPECT_LT(std::sqrt(difference / squares), 0.005);
}

/// The force that the first user feels with a world whose cycles seem to cost `cost_s(time)`.
template <class Cost>
std::vector<Vec3> felt_at_cost(const Scene& scene, double until_s, std::vector<double>& changes_s, const Cost& cost_s) {
  constexpr int kManyTimes = 200;  // so that the cost of a cycle is known at once
  CoupledRun run(scene);
  int ratio = scene.settings.ratio;
  while (run.world.facts().time_s < until_s) {
    const double now_s = run.world.facts().time_s;
    for (int i = 0; i < kManyTimes; ++i) run.world.took(cost_s(now_s));
    run.cycle();
    if (run.world.facts().ratio != ratio) changes_s.push_back(now_s);
    ratio = run.world.facts().ratio;
  }
  return run.felt[0].force;
}

TEST(AdaptiveRatio, AChangeDuringContactIsNoStepInTheForce) {
  constexpr double kMostStep_n = 0.2;
  constexpr double kPressed_s = 1.0, kUntil_s = 2.2;
  const Scene scene = scene_of("row", {4, 12});
  // The tool pushes from 0.5 s on; from then on only the ratio differs.
  std::vector<double> none, changes_s;
  const auto constant = felt_at_cost(scene, kUntil_s, none, [](double) { return 1e-4; });
  const auto changing = felt_at_cost(scene, kUntil_s, changes_s, [](double t) {
    return t > kPressed_s && static_cast<int>(5.0 * t) % 2 == 0 ? 8e-3 : 1e-4;
  });
  const auto pressed = std::ranges::count_if(changes_s, [](double t) { return t > kPressed_s; });
  ASSERT_GE(pressed, 5);
  for (std::size_t i = 1000; i + 1 < std::min(constant.size(), changing.size()); ++i) {
    const Vec3 step = (changing[i + 1] - constant[i + 1]) - (changing[i] - constant[i]);
    ASSERT_LT(step.norm(), kMostStep_n) << "at " << 1e-3 * static_cast<double>(i) << " s";
  }
}

// The last long cycle before short ones has the time of a short one: the sub-worlds are ahead and already make short
// ones.
TEST(AdaptiveRatio, TheCycleBeforeShorterOnesHasNoMoreSubStepsThanFitTheirTime) {
  constexpr double kPart_s = 1.5e-3;
  const Scene scene = scene_of("row", {4, 12});
  CoupledRun run(scene);
  int seen = 0, most_substeps = 0;
  while (run.world.facts().time_s < 1.0) {
    for (int i = 0; i < 200; ++i) run.world.took(kPart_s * run.world.facts().substeps);
    run.cycle();
    const int ratio = run.world.facts().ratio, next = run.world.timetable().ratio(run.world.facts().stamp);
    if (ratio == 12 && next == 12) most_substeps = std::max(most_substeps, run.world.facts().substeps);
    if (ratio <= next) continue;
    ++seen;
    EXPECT_LE(kPart_s * run.world.facts().substeps, RatioControl::kOverShare * next * scene.settings.h_s);
  }
  EXPECT_GE(seen, 1);
  EXPECT_EQ(most_substeps, 3) << "with enough time, the requested number";
}

TEST(AdaptiveRatio, AnOperatorAtRestInContactNeedsNoShortCycles) {
  Scene scene = scene_of("row", {4, 10});
  scene.users[0].device.path.pop_back();  // it stays at its pushed position
  CoupledRun run(scene);
  while (run.world.facts().time_s < 3.0) run.cycle();
  EXPECT_GT(run.felt[0].force.back().norm(), 1.0) << "it leans on the row";
  EXPECT_GT(run.frame().border_contacts, 0U);
  EXPECT_EQ(run.world.facts().ratio, 10);
}

TEST(AdaptiveRatio, AFrameHasTheLengthOfItsCycle) {
  CoupledRun run(scene_of("row", {4, 10}));
  double before_s = 0.0;
  bool changed = false;
  while (run.world.facts().time_s < 0.5) {
    run.cycle();
    if (run.world.facts().stamp == 0) continue;
    ASSERT_NEAR(run.frame().cycle_s, run.frame().stamp_s - before_s, 1e-12) << "at " << before_s;
    changed |= run.world.facts().ratio != 4;
    before_s = run.frame().stamp_s;
  }
  EXPECT_TRUE(changed);
}

// Impulses are sums over the cycle in which they occurred, independent of the length of the present one.
TEST(AdaptiveRatio, AFrozenBorderDividesItsImpulsesOverTheirOwnCycle) {
  const Scene scene = scene_of("row", {4, 10});
  Settings settings = scene.settings;
  settings.scheme = "paper";
  const auto engine = make_engine(settings.haptic, scene.meshes);
  const auto cube = std::ranges::find_if(scene.bodies, [](const Body& body) { return !body.fixed(); });
  engine->add(*cube, scene.initial[index(cube->id)]);
  const auto border = scheme_of(settings).make_sub_world_side(scene, 16);
  WorldFrame frame;
  frame.cycle_s = 0.010;
  frame.border.push_back({.inside = cube->id,
                          .point = scene.initial[index(cube->id)].position,
                          .normal = Vec3::UnitX(),
                          .normal_impulse = 0.5});
  border->follow(frame, *engine, {});
  border->begin(*engine, 0.001, 0.0, {});
  EXPECT_NEAR(cube->mass * engine->state(cube->id).linear_velocity.x(), 0.05, 1e-9);
}

TEST(AdaptiveRatio, ASubWorldThatMissedAChangeReportsItAndRestarts) {
  const Scene scene = scene_of("row", {4, 12});
  World world(scene);
  world.settle([](double) { return true; });
  SubWorld sub(scene, 0);
  ASSERT_TRUE(sub.reset_from(world.frame(0)));
  const DeviceState device;
  WorldFrame before, after;
  // No frames reach the sub-world until the change is over: without an operator the ratio grows.
  while (world.timetable().newest().stamp == 0 || world.facts().stamp < world.timetable().newest().stamp + 3) {
    world.step();
    after = world.frame(0);
    if (world.facts().stamp + 1 == world.timetable().newest().stamp) before = after;
  }
  while (sub.facts().stamp <= after.stamp) {
    (void)sub.step(
        {.device = &device, .wall_s = scene.settings.h_s, .dt = scene.settings.h_s}, [](const FeltStep&) {},
        [&] { (void)sub.close_cycle(1); });
  }
  EXPECT_FALSE(world.receive(HapticReport(*sub.close_cycle(1)))) << "its stamps are of other times";
  EXPECT_FALSE(sub.clock().agrees(before)) << "the report is older than the change, and says so";
  ASSERT_FALSE(sub.clock().agrees(after));
  ASSERT_TRUE(sub.reset_from(after));
  EXPECT_TRUE(sub.clock().agrees(after));
  EXPECT_NEAR(sub.facts().time_s, world.facts().time_s, 1e-9);
  EXPECT_NEAR(sub.clock().left_s(), scene.settings.longest_cycle_s(), 1e-9);
}

// Sub-steps of the world serve pushes. An engine that drives the proxies in parts of its own step needs no others.
TEST(WorldSteps, AreWholeCyclesWhereTheEngineDrivesTheProxies) {
  const auto substeps = [](const std::string& file, const std::string& preset) {
    Scene scene = load_scene(std::string(SCENES_FOLDER) + file);
    keep_users(scene, 1);
    scene.settings.ratio = 16;
    scene.settings.world.preset = preset;
    CoupledRun run(scene);
    for (int i = 0; i < 30; ++i) run.cycle();
    return run.world.facts().substeps;
  };
  EXPECT_EQ(substeps("/press.yaml", "large"), 1);
  EXPECT_EQ(substeps("/press.yaml", "quality"), 4);
  EXPECT_EQ(substeps("/lever.yaml", "large"), 4) << "joints are solved mechanism by mechanism";
}

}  // namespace
}  // namespace subworld
