#include "coupling/select/border.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/metrics.hpp"
#include "lab/session/variants.hpp"
#include "support/grid.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace subworld {
namespace {

Scene scene_of(const std::string& name, const std::string& scheme, int ratio) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
  scene.settings.scheme = scheme;
  scene.settings.ratio = ratio;
  keep_users(scene, scene.settings.users == 0 ? static_cast<int>(scene.users.size()) : scene.settings.users);
  return scene;
}

struct Seen {
  std::size_t border_contacts = 0;
  std::size_t fewest_members = 1000;
  std::size_t most_members = 0;
};

double largest(const std::vector<Vec3>& forces) {
  double most = 0.0;
  for (const Vec3& f : forces) most = std::max(most, f.norm());
  return most;
}

Seen run_all(CoupledRun& run, double duration_s) {
  Seen seen;
  while (run.world.facts().time_s < duration_s - 1e-9) {
    run.cycle();
    seen.border_contacts = std::max<std::size_t>(seen.border_contacts, run.frame().border_contacts);
    seen.fewest_members = std::min(seen.fewest_members, run.frame().members.size());
    seen.most_members = std::max(seen.most_members, run.frame().members.size());
  }
  return seen;
}

struct Closed {
  std::string scene;
  std::string scheme;
  int ratio;
  double box_half_m = 0.2;
};

std::ostream& operator<<(std::ostream& out, const Closed& c) { return out << c.scene << c.scheme << c.ratio; }

class ClosedScene : public testing::TestWithParam<Closed> {};

// Without a border there is no error: the reference is the whole scene in one world at the haptic step. World steps of
// at most 2.5 ms, because the motion of a cube that left the box has the world's own truncation error.
TEST_P(ClosedScene, IsFeltWithoutError) {
  const Closed& c = GetParam();
  // A body that sleeps and wakes is solved from another first guess, and in `scatter` any difference grows.
  Scene whole = scene_of(c.scene, "direct", 1);
  whole.settings.disable(disabled(Optimisation::rest));
  CoupledRun reference(whole);
  ASSERT_TRUE(reference.run());
  Scene scene = scene_of(c.scene, c.scheme, c.ratio);
  scene.settings.disable(disabled(Optimisation::rest));
  scene.settings.world.substeps = c.ratio > 4 ? 4 : 1;
  scene.users[0].box_half_m = c.box_half_m;
  CoupledRun coupled(scene);
  const Seen seen = run_all(coupled, scene.settings.duration_s);
  EXPECT_EQ(seen.border_contacts, 0U);
  EXPECT_GT(largest(reference.felt[0].force), 1.0);
  EXPECT_LE(force_error(coupled.felt[0].force, reference.felt[0].force, scene.settings.h_s).rms, 0.005);
}

std::string name_of_closed(const testing::TestParamInfo<Closed>& tested) {
  return tested.param.scene + "_" + tested.param.scheme + "_r" + std::to_string(tested.param.ratio);
}
INSTANTIATE_TEST_SUITE_P(Scenes, ClosedScene,
                         testing::Values(Closed{"press", "paper", 1}, Closed{"press", "paper", 10},
                                         Closed{"press", "reduced", 4}, Closed{"press", "reduced", 20, 0.1},
                                         Closed{"scatter", "paper", 4}, Closed{"scatter", "reduced", 10}),
                         name_of_closed);
INSTANTIATE_TEST_SUITE_P(Full, ClosedScene,
                         testing::Values(Closed{"press", "reduced", 10}, Closed{"scatter", "paper", 10},
                                         Closed{"scatter", "reduced", 4}),
                         name_of_closed);

double error_on_row(const std::string& scheme, int ratio, const std::vector<Vec3>& reference,
                    const DelaySettings& delay = {}) {
  Scene scene = scene_of("row", scheme, ratio);
  scene.settings.world.substeps = 1;
  scene.settings.delay = delay;
  CoupledRun run(scene);
  EXPECT_TRUE(run.run());
  const double work_j = run.subs[0]->facts().device_work_j;
  if (scheme == "reduced") {
    EXPECT_LE(run.world.facts().energy_excess_j, 1e-3 * work_j);
  }
  return force_error(run.felt[0].force, reference, scene.settings.h_s).rms;
}

// With a border, and with delay; the limits are the design goals of the scheme.
TEST(Reduced, FollowsTheReferenceThroughTheBorderOfTheRow) {
  CoupledRun reference(scene_of("row", "direct", 1));
  ASSERT_TRUE(reference.run());
  const std::vector<Vec3>& force = reference.felt[0].force;
  EXPECT_LE(error_on_row("reduced", 1, force), 0.005);
  EXPECT_LE(error_on_row("reduced", 4, force), 0.01);
  EXPECT_LE(error_on_row("reduced", 10, force), 0.03);
  EXPECT_LE(error_on_row("reduced", 20, force), 0.095);
  EXPECT_LE(error_on_row("reduced", 5, force, {.up_s = 0.01, .down_s = 0.01}), 0.05);
  EXPECT_LE(error_on_row("reduced", 5, force, {.up_s = 0.05, .down_s = 0.05}), 0.20);
  const DelaySettings jittering{.up_s = 0.005, .down_s = 0.005, .jitter_s = 0.01};
  EXPECT_LE(2.0 * error_on_row("reduced", 10, force, jittering), error_on_row("paper", 10, force, jittering));
}

/// Force in the whole scene in one world at the haptic step. It depends neither on the box nor on ratio and delay.
std::vector<Vec3> reference_of(Scene scene) {
  scene.settings.scheme = "direct";
  scene.settings.ratio = 1;
  scene.settings.delay = {};
  CoupledRun reference(scene);
  EXPECT_TRUE(reference.run());
  return reference.felt[0].force;
}

double error_of(const Scene& scene, const std::vector<Vec3>& reference) {
  CoupledRun coupled(scene);
  EXPECT_TRUE(coupled.run());
  EXPECT_LE(coupled.world.facts().energy_excess_j, 1e-3 * coupled.subs[0]->facts().device_work_j);
  return force_error(coupled.felt[0].force, reference, scene.settings.h_s).rms;
}
double error_of(const Scene& scene) { return error_of(scene, reference_of(scene)); }

class PushedAside : public testing::TestWithParam<std::string> {};

// A push off the centre and to the side turns the outside bodies.
TEST_P(PushedAside, IsFeltThroughABorderThatTurns) {
  Scene scene = scene_of(GetParam(), "reduced", 4);
  PathSegment& push = scene.users[0].device.path.at(0);
  push.displacement.y() -= 0.02;
  push.to_s = 1.6;
  EXPECT_LE(error_of(scene), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Scenes, PushedAside, testing::Values("heavy_outside", "hidden_load", "pyramid"),
                         [](const auto& tested) { return tested.param; });

class UnseenScenes : public testing::TestWithParam<std::tuple<std::string, int>> {};

// The limits also hold for scenes that were not used for tuning.
TEST_P(UnseenScenes, AreFeltThroughTheirBorder) {
  const auto& [name, variant] = GetParam();
  CoupledRun reference(varied(scene_of(name, "direct", 1), variant));
  ASSERT_TRUE(reference.run());
  const auto error = [&](int ratio, int substeps) {
    Scene scene = varied(scene_of(name, "reduced", ratio), variant);
    scene.settings.world.substeps = substeps;
    CoupledRun coupled(scene);
    EXPECT_TRUE(coupled.run());
    return force_error(coupled.felt[0].force, reference.felt[0].force, scene.settings.h_s).rms;
  };
  EXPECT_LE(error(4, 1), 0.025);
  EXPECT_LE(error(10, 1), 0.04);
  EXPECT_LE(error(10, 4), 0.025);
  EXPECT_LE(error(20, 4), 0.035);
}

const auto kUnseen = test::quarter(
    test::halves<std::string, int>({"row", "raft", "hidden_load", "heavy_outside", "slope", "pyramid"}, {1, 2}));
std::string name_of_unseen(const testing::TestParamInfo<std::tuple<std::string, int>>& tested) {
  return std::get<0>(tested.param) + "_" + std::to_string(std::get<1>(tested.param));
}
INSTANTIATE_TEST_SUITE_P(Variants, UnseenScenes, testing::ValuesIn(kUnseen.half), name_of_unseen);
INSTANTIATE_TEST_SUITE_P(Full, UnseenScenes, testing::ValuesIn(kUnseen.other), name_of_unseen);

// If the ghost moved as the world's body, the errors would be 4 and 14 %.
TEST(Reduced, TipsAndMovesBodiesThatTheInsideCarries) {
  const std::vector<Vec3> reference = reference_of(scene_of("see_saw", "reduced", 20));
  EXPECT_LE(error_of(scene_of("see_saw", "reduced", 20), reference), 0.04);
  Scene late = scene_of("see_saw", "reduced", 5);
  late.settings.delay = {.up_s = 0.05, .down_s = 0.05};
  EXPECT_LE(error_of(late, reference), 0.05);
}

// With axes oblique to the floor, both of which hold the cube, the errors would be 14, 26 and 11 %.
TEST(Reduced, SlidesUnderABodyThatLeansOnTheOutside) {
  const auto smoother = [](Scene scene) {
    for (Body& body : scene.bodies) body.material.friction = body.name == "board" ? 0.2 : 0.3;
    return scene;
  };
  const std::vector<Vec3> reference = reference_of(smoother(scene_of("leaning", "reduced", 1)));
  EXPECT_LE(error_of(smoother(scene_of("leaning", "reduced", 1)), reference), 0.005);
  EXPECT_LE(error_of(smoother(scene_of("leaning", "reduced", 4)), reference), 0.01);
  EXPECT_LE(error_of(scene_of("leaning", "reduced", 20)), 0.06);
}

// With the largest box the row hits the heavy cube; with the next one the ghost of the row's last cube does; with the
// smallest one a cube that the ghost pushes. Without prediction, a sub-world with 0.1 s of delay feels this contact one
// cycle plus the delay late: 18 %.
TEST(Reduced, FeelsAnApproachingBodyBehindTheBorderAtOnce) {
  const auto loose = [](int ratio, double box_half_m, double delay_s) {
    Scene scene = scene_of("loose", "reduced", ratio);
    scene.users[0].box_half_m = box_half_m;
    scene.settings.delay = {.up_s = 0.5 * delay_s, .down_s = 0.5 * delay_s};
    return scene;
  };
  const std::vector<Vec3> reference = reference_of(loose(1, 0.4, 0.0));
  for (const double box_half_m : {0.4, 0.3, 0.2}) {
    EXPECT_LE(error_of(loose(20, box_half_m, 0.0), reference), 0.025) << box_half_m;
    EXPECT_LE(error_of(loose(5, box_half_m, 0.02), reference), 0.01) << box_half_m;
    EXPECT_LE(error_of(loose(5, box_half_m, 0.1), reference), 0.02) << box_half_m;
  }
}

// A brick falls off the slab that the tool has pushed. In a sub-world that is ahead, the ghost of the brick has no
// floor. When the floor holds it again, it must not start inside the slab: that gave a step of 19 N to an operator
// without contact.
TEST(Reduced, ABodyThatFallsOffDoesNotPushTheOperator) {
  for (const double delay_s : {0.02, 0.03}) {
    Scene scene = scene_of("toppling", "reduced", 5);
    scene.settings.delay = {.up_s = 0.5 * delay_s, .down_s = 0.5 * delay_s};
    EXPECT_LE(error_of(scene), 0.04) << delay_s;
  }
}

// A fast impact, at each phase of a cycle. In some phases the world's impact is a cycle later than the sub-world's.
// Correcting the velocities by that would give an error of 29 % with 100 ms of delay.
TEST(Reduced, TakesAnEarlierImpactInOneCopyForNoError) {
  for (int phase = 0; phase < 5; ++phase) {
    Scene scene = scene_of("loose", "reduced", 5);
    Body& heavy = *std::ranges::find(scene.bodies, "heavy", &Body::name);
    heavy.mass *= 2.0;
    heavy.inertia *= 2.0;
    PathSegment& push = scene.users[0].device.path.at(0);
    push.from_s = 0.2 + 0.001 * phase;
    push.to_s = push.from_s + 0.4;
    scene.settings.delay = {.up_s = 0.05, .down_s = 0.05};
    EXPECT_LE(error_of(scene), 0.05) << phase;
  }
}

// The row hits a ball, which then rolls in front of it. If the ghost slid instead, and the impact counted as friction,
// the force error would be 8 % with 20 ms of delay and 29 % with 100 ms.
TEST(Reduced, FeelsARollingBody) {
  const auto rolling = [](int ratio, double delay_s) {
    Scene scene = scene_of("loose", "reduced", ratio);
    const auto ball = std::ranges::find(scene.bodies, "heavy", &Body::name);
    ball->shape = {.kind = ShapeKind::sphere, .radius = 0.05};
    ball->mass = 0.5;
    ball->inertia = Vec3::Constant(0.4 * 0.5 * 0.05 * 0.05);
    scene.settings.delay = {.up_s = 0.5 * delay_s, .down_s = 0.5 * delay_s};
    return scene;
  };
  const std::vector<Vec3> reference = reference_of(rolling(1, 0.0));
  EXPECT_LE(error_of(rolling(20, 0.0), reference), 0.03);
  EXPECT_LE(error_of(rolling(5, 0.02), reference), 0.025);
  EXPECT_LE(error_of(rolling(5, 0.1), reference), 0.09);
}

// Figure 8 b: the proxy in the middle of a stack. The sub-world's ends are border bodies that carry the load of the
// outside cubes: without border impulses the lower members would fall.
TEST(Figure8b, BorderImpulsesCarryTheStackOutside) {
  Scene scene = scene_of("tower_inside", "paper", 4);
  scene.settings.settle_s = 3.0;  // until the stack no longer oscillates
  CoupledRun run(scene);
  const WorldFrame& frame = run.frame();
  ASSERT_FALSE(frame.border.empty());
  Vec3 up = Vec3::Zero();
  Vec3 down = Vec3::Zero();
  for (const BoundaryContact& pair : frame.border)
    (pair.normal.z() > 0.0 ? up : down) += pair.normal_impulse * pair.normal;
  const double cycle_s = 0.004;
  std::size_t below = 0, above = 0;
  double lowest = 1e9, highest = -1e9;
  for (const StampedBody& s : frame.states) {
    lowest = std::min(lowest, s.state.position.z());
    highest = std::max(highest, s.state.position.z());
  }
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    below += scene.initial[index(body.id)].position.z() < lowest - 0.05;
    above += scene.initial[index(body.id)].position.z() > highest + 0.05;
  }
  ASSERT_GT(below, 0U);
  ASSERT_GT(above, 0U);
  EXPECT_NEAR(-down.z() / cycle_s, static_cast<double>(above) * 0.2 * 9.81,
              0.1 * static_cast<double>(above) * 0.2 * 9.81);  // the weight above presses down
  EXPECT_GT(up.z(), -down.z());                                // the support below carries more
}

// Figure 9: every border contact has exactly one of its bodies inside.
TEST(Figure9, BorderContactsCrossTheBoundary) {
  CoupledRun run(scene_of("row", "paper", 4));
  for (int i = 0; i < 100; ++i) run.cycle();
  const WorldFrame& frame = run.frame();
  ASSERT_FALSE(frame.border.empty());
  for (const BoundaryContact& pair : frame.border) {
    EXPECT_TRUE(std::binary_search(frame.members.begin(), frame.members.end(), pair.inside));
    EXPECT_FALSE(std::binary_search(frame.members.begin(), frame.members.end(), pair.outside));
    EXPECT_FALSE(std::binary_search(frame.fixed.begin(), frame.fixed.end(), pair.outside));
  }
}

// Figure 10: only the base of a tower is inside, but its friction is that of the whole tower. A push that would move
// the base alone does not move it.
TEST(Figure10, TheBaseFeelsTheTowerAboveIt) {
  CoupledRun run(scene_of("tower_base", "paper", 4));
  const Scene scene = scene_of("tower_base", "paper", 4);
  const WorldFrame& frame = run.frame();
  const auto movable = static_cast<std::size_t>(
      std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return !b.fixed(); }));
  ASSERT_LT(frame.members.size(), movable);
  ASSERT_FALSE(frame.border.empty());
  double pressed = 0.0;
  for (const BoundaryContact& pair : frame.border) pressed -= pair.normal_impulse * pair.normal.z();
  const double outside = static_cast<double>(movable - frame.members.size()) * 0.2 * 9.81 * 0.004;
  EXPECT_NEAR(pressed, outside, 0.1 * outside);
}

// Figure 14: three of the ten cubes are members, and the felt force is that of the whole row.
TEST(Figure14, TheRowIsFeltThroughThreeCubes) {
  CoupledRun run(scene_of("row", "paper", 4));
  while (run.world.facts().time_s < 2.0) run.cycle();
  EXPECT_EQ(run.frame().members.size(), 4U);     // with the proxy
  const double sliding = 10 * 0.5 * 0.2 * 9.81;  // mu m g of all ten
  double most = 0.0;
  for (const Vec3& f : run.felt[0].force) most = std::max(most, std::abs(f.x()));
  EXPECT_GT(most, 0.8 * sliding);
  EXPECT_GT(run.world.engine().state(scene_of("row", "paper", 4).users[0].proxy).position.x(), -0.08);
}

// In a pushed row, each further contact adds one cube; the box contains only the first one.
TEST(Membership, FollowsTheContactsToTheDepthAskedFor) {
  Scene scene = scene_of("row", "reduced", 4);
  scene.users[0].box_half_m = 0.05;
  scene.users[0].contact_depth = 3;
  CoupledRun run(scene);
  while (run.world.facts().time_s < 1.0) run.cycle();
  EXPECT_EQ(run.frame().members.size(), 4U);  // with the proxy
}

TEST(Membership, BodiesEnterAndLeaveWhileRunning) {
  CoupledRun run(scene_of("scatter", "paper", 4));
  const Seen seen = run_all(run, 2.0);
  EXPECT_LT(seen.fewest_members, seen.most_members);
  EXPECT_EQ(run.subs[0]->facts().members, run.frame().members.size());
}

class PeersNonsense : public testing::TestWithParam<const char*> {};

// A frame with unknown bodies is treated as lost.
TEST_P(PeersNonsense, IsRefusedAndTheNextFrameCountsIt) {
  CoupledRun run(scene_of("row", GetParam(), 4));
  for (int i = 0; i < 200; ++i) run.cycle();
  SubWorld& sub = *run.subs[0];
  const BodyId nobody{4'000'000'000};
  const auto broken = [&](auto spoil) {
    WorldFrame frame = run.frame();
    ++frame.stamp;
    spoil(frame);
    return frame;
  };
  const GhostModel ghost{.outside = nobody, .mass_kg = 1.0, .axis_count = 1, .axes = {}};
  for (const WorldFrame& frame :
       {broken([&](WorldFrame& f) { f.members.push_back(nobody); }),
        broken([&](WorldFrame& f) { f.fixed.push_back(nobody); }),
        broken([&](WorldFrame& f) { f.peers.push_back({.proxy = nobody, .pose = {}}); }), broken([&](WorldFrame& f) {
          f.ghosts.push_back(ghost), f.states.push_back({nobody, {}});
        }),
        broken([&](WorldFrame& f) {
          f.ghosts.assign(1, ghost), f.ghosts[0].outside = BodyId{10};
          f.ghosts[0].carried = CarriedBody{.mass_kg = 1e-9, .inertia_kg_m2 = Eigen::Matrix3d::Identity(), .drive = {}};
        }),
        broken([&](WorldFrame& f) { f.entering.push_back({}), f.entering.back().body.id = nobody; })}) {
    EXPECT_EQ(sub.synchronise_with(frame), 0U);
  }
  WorldFrame good = run.frame();
  good.stamp += 2;
  EXPECT_EQ(sub.synchronise_with(good), 1U);
  (void)sub.step(
      {.dt = 0.001}, [](const FeltStep&) {}, [] {});
  EXPECT_TRUE(sub.facts().finite);
}

// A frame of a world that assumes that this sub-world has already reported.
TEST(Join, AFrameWithoutTheProxyIsNoBeginning) {
  const Scene scene = scene_of("row", "reduced", 4);
  CoupledRun run(scene);
  WorldFrame frame = run.frame();
  SubWorld late(scene, 0);
  ASSERT_FALSE(frame.entering.empty());
  frame.entering.clear();
  EXPECT_FALSE(late.reset_from(frame));
  EXPECT_TRUE(late.reset_from(run.frame()));
}

// Finite but unphysical: the ghost flies off, the force on the operator stays bounded, and the run continues.
TEST(Reduced, AnUnphysicalDriveLeavesTheForceBounded) {
  for (const double force_n : {1e12, 1e308, -1e308}) {
    CoupledRun run(scene_of("see_saw", "reduced", 4));
    for (int i = 0; i < 150; ++i) run.cycle();
    SubWorld& sub = *run.subs[0];
    WorldFrame frame = run.frame();
    ++frame.stamp;
    ASSERT_TRUE(!frame.ghosts.empty() && frame.ghosts[0].carried);
    frame.ghosts[0].carried->drive = {Vec3(0, 0, force_n), Vec3(0, force_n, 0)};
    sub.synchronise_with(frame);
    const DeviceState device;
    for (int i = 0; i < 200; ++i) {
      const FeltStep felt = sub.step(
          {.device = &device, .wall_s = 0.001, .dt = 0.001}, [](const FeltStep&) {}, [] {});
      ASSERT_TRUE(felt.to_operator.force.allFinite());
      ASSERT_LE(felt.to_operator.force.norm(), 40.0 + 1e-9);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Schemes, PeersNonsense, testing::Values("direct", "paper", "reduced"),
                         [](const auto& one) { return std::string(one.param); });

TEST(Lockstep, EqualRunsHaveEqualHashes) {
  const auto hash = [] {
    CoupledRun run(scene_of("row", "paper", 4));
    for (int i = 0; i < 100; ++i) run.cycle();
    return run.world.facts().state_hash;
  };
  EXPECT_EQ(hash(), hash());
}

// The lab treats a device as the programs do: an admittance device also rotates with the proxy.
TEST(CoupledRun, TurnsAnAdmittanceDevice) {
  Scene scene = load_text(test::kTurningAdmittanceDevice);
  keep_users(scene, 1);
  CoupledRun run(scene);
  ASSERT_TRUE(run.run());
  const Quat& device = run.devices[0]->state().pose.orientation;
  EXPECT_NEAR(device.angularDistance(Quat::Identity()), 20.0 * M_PI / 180.0, 0.05) << "rad";
  EXPECT_LT(device.angularDistance(run.subs[0]->facts().proxy.orientation), 0.01) << "rad";
}

}  // namespace
}  // namespace subworld
