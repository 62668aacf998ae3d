#include "coupling/schemes/reduced/ghosts.hpp"
#include "lab/session/coupled_run.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {
namespace {

constexpr double kForceStep_n = 0.3;  ///< largest step of the felt force from a change of members
constexpr double kSlow_s = 1.0, kQuick_s = 1e-9;

struct MembershipCase {
  const char* scene;
  double change_s;
  double budget_ratio;
  double step_s;  ///< step time that the sub-world reports from then on
};

/// Felt forces, and members by cycle.
struct FeltMembers {
  std::vector<Vec3> force;
  std::vector<std::vector<BodyId>> members;
};

FeltMembers felt(const MembershipCase& c, bool changes) {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + c.scene + ".yaml");
  keep_users(scene, 1);
  scene.settings.scheme = "reduced";
  scene.settings.ratio = 4;
  scene.settings.duration_s = c.change_s + 0.5;
  scene.users[0].budget_ratio = c.budget_ratio;
  CoupledRun run(scene);
  FeltMembers result;
  while (!run.world.facts().over) {
    if (changes && run.world.facts().time_s >= c.change_s) run.haptic_step_s = c.step_s;
    run.cycle();
    result.members.push_back(run.frame().members);
  }
  result.force = run.felt[0].force;
  return result;
}

class ChangeOfMembers : public testing::TestWithParam<MembershipCase> {};

// Two runs that are equal until the budget of one changes.
TEST_P(ChangeOfMembers, IsNotFelt) {
  const FeltMembers same = felt(GetParam(), false);
  const FeltMembers changed = felt(GetParam(), true);
  const std::size_t steps = std::min(same.force.size(), changed.force.size());
  const auto apart = [&](std::size_t n) -> Vec3 { return changed.force[n] - same.force[n]; };
  std::size_t first = 0;
  while (first < steps && apart(first).isZero()) ++first;
  ASSERT_LT(first, steps) << "no change of members was felt at all";
  EXPECT_NE(same.members.back(), changed.members.back());
  // The cycle that begins with the change. Later differences are those of the motion, which in a heap is chaotic.
  for (std::size_t n = first; n < std::min(first + 4, steps); ++n) {
    EXPECT_LE((apart(n) - apart(n - 1)).norm(), kForceStep_n) << GetParam().scene << ", step " << n;
  }
}

// The world's body accelerates by 4 m/s^2, the ghost does not. Over two cycles the difference is that of an impact
// within one. It is an error all the same, and is corrected, whether the frame between them arrives or not.
TEST(Ghosts, AnErrorOverALostFrameIsNoImpact) {
  const Scene scene = load_scene(std::string(SCENES_FOLDER) + "/row.yaml");
  const auto cube = std::ranges::find(scene.bodies, ShapeKind::box, [](const Body& b) { return b.shape.kind; });
  constexpr double kCycle_s = 0.004, kPerCycle_m_s = 4.0 * kCycle_s;
  for (const bool lost : {false, true}) {
    const auto engine = make_engine(scene.settings.haptic, scene.meshes);
    Ghosts ghosts(scene, 16);
    GhostModel model{.outside = cube->id, .mass_kg = cube->mass, .axis_count = 1, .axes = {}};
    model.axes[0].normal = Vec3::UnitX();
    for (std::uint64_t stamp = 1; stamp <= 3; ++stamp) {
      WorldFrame frame;
      frame.stamp = stamp;
      frame.cycle_s = kCycle_s;
      frame.ghosts.push_back(model);
      frame.states.push_back({cube->id, scene.initial[index(cube->id)]});
      frame.states[0].state.linear_velocity.x() = kPerCycle_m_s * static_cast<double>(stamp);
      if (stamp == 2 && lost) {
        ghosts.log(stamp, *engine);
        continue;
      }
      if (stamp > 1) ghosts.log(stamp, *engine);
      ghosts.follow(frame, *engine, {.gain = 0.5});
      if (stamp == 1) ghosts.log(stamp, *engine);
    }
    EXPECT_NEAR(engine->state(cube->id).linear_velocity.x(), 3 * kPerCycle_m_s, 1e-9) << "lost: " << lost;
  }
}

// A ball is thrown past the tool, into its sub-world and out of it on both ways.
TEST(Membership, ABallThatFliesThroughFallsFreely) {
  constexpr double kSpeed_m_s = 10.0;
  for (const double way_s : {0.0, 0.01}) {
    CoupledRun run(load_text(fmt::format(R"(
name: throw
settings: {{duration_s: 1.9, ratio: 5, users: 1, delay: {{up_s: {0}, down_s: {0}}}}}
bodies:
  - {{name: ball, shape: sphere, radius_m: 0.05, mass_kg: 1, position_m: [0.3, 0, 0.1], velocity_m_s: [0, 0, 10]}}
users:
  - name: user
    proxy: {{shape: sphere, radius_m: 0.03, mass_kg: 0.1, position_m: [0, 0, 1.5], rotates: false, gravity: false}}
    coupling: {{stiffness_n_m: 1000, damping_n_s_m: 20}}
    box_half_m: 0.4
)",
                                         way_s)));
    std::size_t most_members = 0;
    double worst_m_s = 0.0;
    while (!run.world.facts().over) {
      run.cycle();
      const double falling_m_s = kSpeed_m_s - 9.81 * run.world.facts().time_s;
      worst_m_s = std::max(worst_m_s, std::abs(run.world.engine().state(BodyId{0}).linear_velocity.z() - falling_m_s));
      most_members = std::max(most_members, run.frame().members.size());
    }
    EXPECT_EQ(most_members, 2U);
    EXPECT_LT(worst_m_s, 1e-6) << "with " << way_s << " s each way";
  }
}

std::string name_of_change(const testing::TestParamInfo<MembershipCase>& one) {
  return std::string(one.param.scene) + (one.param.step_s == kQuick_s ? "_grows" : "_shrinks");
}
INSTANTIATE_TEST_SUITE_P(Scenes, ChangeOfMembers,
                         testing::Values(MembershipCase{"heap_press", 0.5, 0.1, kQuick_s},
                                         MembershipCase{"row", 0.8, 0.15, kSlow_s},
                                         MembershipCase{"row", 0.8, 0.03, kQuick_s},
                                         MembershipCase{"pyramid", 0.8, 0.1, kSlow_s}),
                         name_of_change);
INSTANTIATE_TEST_SUITE_P(Full, ChangeOfMembers, testing::Values(MembershipCase{"heap_press", 0.5, 0.2, kSlow_s}),
                         name_of_change);

}  // namespace
}  // namespace subworld
