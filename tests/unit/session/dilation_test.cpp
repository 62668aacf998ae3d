// A slowed world clock, and the haptic clock that follows it: both controllers as in the loops, on simulated wall time;
// then the force that the operator feels.
#include "device_sim/emulated_device.hpp"
#include "haptic_sim/loops/phase.hpp"
#include "haptic_sim/sub_world.hpp"
#include "rt/arrears.hpp"
#include "support/scene_text.hpp"
#include "world_sim/loops/pace.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

namespace subworld {
namespace {

using Load = std::function<double(double wall_s)>;  // cost of the cycle that begins at that time, in cycles

struct Frame {
  double sent_s, stamp_s, start_in_s, real_time_factor;
  double delay_s = 0.0;  ///< of the network

  [[nodiscard]] double arrives_s() const { return sent_s + delay_s; }
};

/// Frames of a world whose cycles have these costs, as run_realtime publishes them.
std::vector<Frame> world_frames(double cycle_s, double wall_s, const Load& load) {
  Pace pace(cycle_s);
  std::vector<Frame> frames;
  double now = 0.0, release = 0.0;
  for (std::uint64_t stamp = 1; now < wall_s; ++stamp) {
    const double begin = std::max(now, release);
    const double deadline = release + pace.period_s();
    now = begin + load(begin) * cycle_s;
    release = deadline + pace.cycle(now - begin, now - deadline);
    frames.push_back({now, static_cast<double>(stamp) * cycle_s, release - now, pace.real_time_factor()});
  }
  return frames;
}

struct Followed {
  double wall_s, haptic_s, rate, ahead_cycles;  ///< ahead of the clock in the newest frame
};

struct Follower {
  double h = 0.001;
  int ratio = 4;
  int lead_cycles = 1;
  bool between_hosts = false;

  /// The haptic loop's clock while it receives those frames.
  [[nodiscard]] std::vector<Followed> follow(const std::vector<Frame>& frames, double wall_s) const {
    const double cycle_s = ratio * h;
    const double ahead_s = lead_cycles > 0 ? lead_cycles * cycle_s + h : 0.0;
    Phase phase(cycle_s, lead_cycles, between_hosts);
    Arrears arrears;
    std::vector<Followed> seen;
    double haptic_s = ahead_s, in_cycle_s = 0.0;
    std::size_t next = 0;
    for (double now = 0.0; now < wall_s; now += h) {
      for (; next < frames.size() && frames[next].arrives_s() <= now; ++next) {
        const Frame& f = frames[next];
        phase.observe(f.stamp_s, ahead_s, 0.0, f.arrives_s() + f.start_in_s - now, f.real_time_factor,
                      haptic_s + arrears.owed_s(), now);
      }
      const double dt = arrears.step(h * phase.step(haptic_s, h), cycle_s - in_cycle_s);
      double ahead = 0.0;
      if (next > 0) {
        const Frame& f = frames[next - 1];
        const double past_s = f.real_time_factor * (now - f.sent_s - f.start_in_s);
        ahead = (haptic_s - ahead_s - f.stamp_s - std::min(past_s, cycle_s)) / cycle_s;
      }
      seen.push_back({now, haptic_s, phase.rate(), ahead});
      haptic_s += dt;
      in_cycle_s += dt;
      if (in_cycle_s > cycle_s - 1e-9) in_cycle_s = 0.0;
    }
    return seen;
  }
};

struct DilationCase {
  const char* name;
  Load load;
  double most_ahead_cycles;
};

void PrintTo(const DilationCase& one, std::ostream* out) { *out << one.name; }

class Dilation : public testing::TestWithParam<DilationCase> {};

TEST_P(Dilation, TheHapticClockFollowsWithoutStoppingJumpingOrRunningAhead) {
  constexpr double kWall_s = 19.0;
  for (const int lead : {0, 1}) {
    SCOPED_TRACE(lead);
    const Follower follower{.lead_cycles = lead};
    const double cycle_s = follower.h * follower.ratio;
    const auto frames = world_frames(cycle_s, kWall_s, GetParam().load);
    const auto seen = follower.follow(frames, kWall_s);
    for (std::size_t i = 1; i < seen.size(); ++i) {
      const double passed = seen[i].haptic_s - seen[i - 1].haptic_s;
      ASSERT_GT(passed, 0.0) << "stopped at " << seen[i].wall_s;
      ASSERT_LE(passed, 2.5 * follower.h) << "jumped at " << seen[i].wall_s;
      ASSERT_LE(std::abs(seen[i].rate - seen[i - 1].rate), Phase::kRateStep * std::max(seen[i - 1].rate, 0.01) + 1e-9)
          << "at " << seen[i].wall_s;
      ASSERT_LT(seen[i].ahead_cycles, GetParam().most_ahead_cycles) << "at " << seen[i].wall_s;
      ASSERT_GT(seen[i].ahead_cycles, -2.0) << "too far behind at " << seen[i].wall_s;
    }
    EXPECT_NEAR(seen.back().ahead_cycles, 0.0, 1.0);
  }
}

const auto kStepUpAndDown = [](double t) { return t > 3.0 && t < 10.0 ? 2.3 : 0.5; };
const auto kStrong = [](double t) { return t > 2.0 && t < 15.0 ? 16.5 + 13.5 * std::sin(t) : 0.5; };  // 0.03 .. 0.3
const auto kRamp = [](double t) { return 0.5 + 30.0 * std::max(0.0, std::min(t, 16.0 - t)) / 8.0; };
const auto kSpikes = [](double t) { return std::fmod(t, 1.0) < 0.004 ? 2.8 : 0.6; };
const auto kStalls = [](double t) { return std::fmod(t, 4.0) > 3.99 ? 6.0 : 0.6; };

INSTANTIATE_TEST_SUITE_P(Loads, Dilation,
                         testing::Values(DilationCase{"light", [](double) { return 0.5; }, 1.5},
                                         DilationCase{"spikes", kSpikes, 2.5},
                                         DilationCase{"step", kStepUpAndDown, 6.0}, DilationCase{"ramp", kRamp, 4.0},
                                         DilationCase{"strong", kStrong, 12.0}, DilationCase{"stalls", kStalls, 8.0}),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(Phase, BetweenHostsTheClockDoesNotFollowEachFramesDelay) {
  constexpr double kWall_s = 10.0, kSettled_s = 2.0, kJitter_s = 0.02, kLoss = 0.1;
  const Follower follower{.between_hosts = true};
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Frame> frames = world_frames(follower.h * follower.ratio, kWall_s, [](double) { return 0.5; });
  std::erase_if(frames, [&](const Frame&) { return uniform(random) < kLoss; });
  for (Frame& frame : frames) frame.delay_s = kJitter_s * uniform(random);
  std::ranges::stable_sort(frames, {}, &Frame::arrives_s);
  for (const Followed& at : follower.follow(frames, kWall_s)) {
    if (at.wall_s < kSettled_s) continue;
    ASSERT_NEAR(at.rate, 1.0, 0.01) << "at " << at.wall_s;
  }
}

TEST(Phase, StopsSoftlyWhereFramesStayAway) {
  Phase phase(0.004, 1);
  phase.observe(0.004, 0.005, 0.0, 0.002, 1.0, 0.007, 0.0);
  double haptic_s = 0.007;
  EXPECT_FALSE(phase.cut_off());
  for (int i = 0; i < 5000; ++i) {
    const double before = phase.rate();
    const double rate = phase.step(haptic_s, 0.001);
    EXPECT_LE(std::abs(rate - before), Phase::kRateStep * std::max(before, 0.01) + 1e-12);
    haptic_s += 0.001 * rate;
  }
  EXPECT_LT(haptic_s, 0.004 + 0.004 * 14) << "a world that is gone is not run ahead of";
  EXPECT_TRUE(phase.cut_off());
}

// A world that has been started again begins 0.2 s after its first frame.
TEST(Phase, StandsUntilAWorldBeginsAndThenRunsAtOnce) {
  constexpr double kH_s = 0.001, kAhead_s = 0.005;
  Phase phase(0.004, 1);
  phase.restart();
  double haptic_s = 5.0, first_s = -1.0;
  phase.observe(haptic_s, kAhead_s, 0.0, 0.2, 0.0, haptic_s, 0.0);
  for (int i = 0; i < 205; ++i) {
    const double wall_s = i * kH_s;
    if (i == 1) phase.observe(5.0, kAhead_s, 0.0, 0.2, 1.0, haptic_s, wall_s);
    const double rate = phase.step(haptic_s, kH_s);
    EXPECT_TRUE(rate == 0.0 || rate > 0.99) << wall_s << " s: " << rate;
    if (rate > 0.0 && first_s < 0.0) first_s = wall_s;
    haptic_s += rate * kH_s;
  }
  EXPECT_NEAR(first_s, kH_s + 0.2 - kAhead_s, 0.002);
}

TEST(Phase, AStandingWorldStopsItAtOnceAndGoesOnAtOnce) {
  Phase phase(0.004, 0);
  phase.observe(0.004, 0.0, 0.0, 0.002, 1.0, 0.002, 0.0);
  EXPECT_EQ(phase.step(0.002, 0.001), 1.0);
  phase.observe(0.004, 0.0, 0.0, 0.004, 0.0, 0.003, 0.001);
  EXPECT_EQ(phase.step(0.003, 0.001), 0.0);
  phase.observe(0.008, 0.0, 0.0, 0.004, 1.0, 0.004, 0.002);
  EXPECT_NEAR(phase.step(0.004, 0.001), 1.0, 0.05);
}

struct SceneRun {
  std::vector<Vec3> forces;  ///< on the operator, N
  std::vector<Pose> device;
  double device_work_j = 0.0, energy_excess_j = 0.0;
};

using Rate = std::function<double(int step)>;

/// One user, the world and its frames in one process, on a clock of which each haptic step covers rate(step) h. The
/// device moves in wall time. Frames arrive in the middle of a cycle, as in real time.
SceneRun run_scene(Scene scene, int steps, const Rate& rate) {
  keep_users(scene, 1);
  scene.settings.disable(disabled(Optimisation::suppression));  // every cycle has its messages, as in real time
  const double h = scene.settings.h_s;
  World world(scene);
  world.settle([](double) { return true; });
  SubWorld sub(scene, 0);
  EmulatedDevice device(scene.users[0].device, 0);
  Arrears arrears;
  const auto lead = static_cast<std::uint64_t>(scheme_of(scene.settings).properties.lead_cycles);
  sub.synchronise_with(world.frame(0));
  std::vector<HapticReport> reports{*sub.close_cycle(1)};
  std::optional<WorldFrame> on_its_way;
  SceneRun run;
  for (int step = 0; step < steps; ++step) {
    if (on_its_way && sub.clock().left_s() < 0.6 * scene.settings.shortest_cycle_s()) {
      sub.synchronise_with(*on_its_way);
      on_its_way.reset();
    }
    const DeviceState state = device.state();
    const auto send = [&](const FeltStep& felt) {
      run.forces.push_back(felt.to_operator.force);
      run.device.push_back(state.pose);
      device.step(sub.command_for(state, felt.to_operator), h);
    };
    const std::size_t reported = reports.size();
    (void)sub.step({.device = &state,
                    .wall_s = h,
                    .dt = arrears.step(h * rate(step), sub.clock().left_s()),
                    .clock_rate = rate(step)},
                   send, [&] { reports.push_back(*sub.close_cycle(1)); });
    if (reports.size() == reported) continue;
    if (reports.size() <= 1 + lead) continue;
    world.receive(HapticReport(reports[reports.size() - 1 - lead]));
    world.receive(HapticReport(reports.back()));
    world.step();
    on_its_way = world.frame(0);
  }
  run.device_work_j = sub.facts().device_work_j;
  run.energy_excess_j = world.facts().energy_excess_j;
  return run;
}

SceneRun run_scene(const std::string& name, int steps, const Rate& rate) {
  return run_scene(load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml"), steps, rate);
}

Rate constant(double rate) {
  return [rate](int) { return rate; };
}

/// Falls from 1 to a fifth in the largest steps of the haptic clock, stays constant, and rises as the world's clock
/// does.
struct Slowing {
  static constexpr double kLow = 0.2;
  static constexpr int kHold = 60;
  int from;
  double rise = std::log(1.0 + Pace::kStep) / 4.0;  ///< a cycle has four steps and more
  double fall = -std::log(1.0 - Phase::kRateStep);
  int rises_at = from + static_cast<int>(std::ceil(-std::log(kLow) / fall)) + kHold;
  int end = rises_at + static_cast<int>(std::ceil(-std::log(kLow) / rise));

  double operator()(int step) const {
    const double log_rate = step < rises_at ? -fall * (step - from) : std::log(kLow) + rise * (step - rises_at);
    return std::exp(std::clamp(log_rate, std::log(kLow), 0.0));
  }
};

double largest_step_n(const std::vector<Vec3>& forces, int from, int to) {
  double most = 0.0;
  for (auto at = static_cast<std::size_t>(from); at < static_cast<std::size_t>(to); ++at)
    most = std::max(most, (forces[at] - forces[at - 1]).norm());
  return most;
}

// An operator who touches a cube at a wall, presses, holds and retreats feels the same at every rate.
TEST(SlowedClock, AStandingObstacleFeelsTheSameAtEachRate) {
  constexpr int kSteps = 1700, kStanding = 1100;  // haptic steps; in between the operator presses without moving
  const SceneRun full = run_scene("press", kSteps, constant(1.0));
  ASSERT_GT(full.forces[kStanding].norm(), 15.0) << "N";
  for (const double rate : {0.5, 0.2, 0.05}) {
    SCOPED_TRACE(rate);
    const SceneRun slowed = run_scene("press", kSteps, constant(rate));
    EXPECT_LE(largest_step_n(slowed.forces, 1, kSteps), largest_step_n(full.forces, 1, kSteps) + 0.05) << "N";
    EXPECT_NEAR(slowed.forces[kStanding].norm(), full.forces[kStanding].norm(), 0.02) << "N";
    EXPECT_NEAR(slowed.device_work_j, full.device_work_j, 0.01 * full.device_work_j);
    EXPECT_LE(slowed.energy_excess_j, 1e-3 * full.device_work_j);
  }
}

// At a rate of 0.2 the apparent mass of the row is 50 kg instead of 2 kg: pushing needs more force, but impacts are not
// harder.
TEST(SlowedClock, AMovingBodyIsHeavierWithoutHarderImpacts) {
  constexpr int kSteps = 2000;
  const SceneRun full = run_scene("row", kSteps, constant(1.0));
  for (const double rate : {0.5, 0.2}) {
    SCOPED_TRACE(rate);
    const SceneRun slowed = run_scene("row", kSteps, constant(rate));
    EXPECT_LE(largest_step_n(slowed.forces, 1, kSteps), largest_step_n(full.forces, 1, kSteps) + 0.3) << "N";
    EXPECT_LE(slowed.energy_excess_j, 1e-3 * slowed.device_work_j);
  }
}

TEST(SlowedClock, ThatStandsLeavesEveryForceFinite) {
  const SceneRun run = run_scene("press", 800, [](int step) { return step < 500 || step > 600 ? 1.0 : 0.0; });
  for (const Vec3& force : run.forces) ASSERT_TRUE(force.allFinite());
}

// An admittance device follows the proxy, and its operator moves in wall time: oscillation and rotation are those at
// full speed.
TEST(SlowedClock, AnAdmittanceDeviceFollowsInWallTime) {
  const Scene scene = load_text(test::kTurningAdmittanceDevice);
  constexpr int kSteps = 800;
  const SceneRun full = run_scene(scene, kSteps, constant(1.0));
  EXPECT_GT(full.device.back().orientation.angularDistance(Quat::Identity()), 0.2) << "rad";
  for (const double rate : {0.5, 0.05}) {
    SCOPED_TRACE(rate);
    const SceneRun slowed = run_scene(scene, kSteps, constant(rate));
    for (std::size_t i = 0; i < full.device.size(); ++i) {
      ASSERT_LT((slowed.device[i].position - full.device[i].position).norm(), 1e-4) << "m, step " << i;
      ASSERT_LT(slowed.device[i].orientation.angularDistance(full.device[i].orientation), 1e-3) << "rad, step " << i;
    }
  }
}

struct FeltClock {
  const char* scene;
  std::vector<int> changes;  ///< steps at which the clock begins to slow: the operator holds, pushes, moves freely
  /// The operator is touched by other bodies too, at other times with another clock. Therefore its steps are compared
  /// with all of the steady run, and the median of several starts, nanometres apart, counts. Each touch of a heap is
  /// random: over eight starts, the largest step of a steady run was 2.1 to 5.9 N.
  bool touches_often = false;
};

class DilationFelt : public testing::TestWithParam<FeltClock> {};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Two equal runs, one with a clock that slows to a fifth and returns to full speed. Its force has no larger steps than
// that of the other, where they come from touching and sliding.
TEST_P(DilationFelt, NoStepInTheForceComesFromTheClock) {
  constexpr double kApart_m = 1e-9;
  const FeltClock& felt = GetParam();
  const int starts = felt.touches_often ? 5 : 1;
  const double most = felt.touches_often ? 1.5 : 1.0;  // times the steady run's: medians of five vary by this factor
  const std::size_t count = felt.changes.size();
  std::vector<std::vector<double>> steady_n(count), slowed_n(count);
  double felt_n = 0.0;
  for (int start = 0; start < starts; ++start) {
    Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + felt.scene + ".yaml");
    for (BodyState& state : scene.initial) state.position.z() += kApart_m * start;
    const SceneRun steady = run_scene(scene, Slowing{felt.changes.back()}.end, constant(1.0));
    for (std::size_t i = 0; i < count; ++i) {
      const int change = felt.changes[i];
      const Slowing slowing{change};
      const SceneRun slowed = run_scene(scene, slowing.end, slowing);
      slowed_n[i].push_back(largest_step_n(slowed.forces, change, slowing.end));
      steady_n[i].push_back(largest_step_n(steady.forces, felt.touches_often ? 1 : change, slowing.end));
      EXPECT_LE(slowed.energy_excess_j, 0.02 * slowed.device_work_j + 1e-4) << "J, from step " << change << " on";
      felt_n = std::max(felt_n, slowed.forces.back().norm());
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_LT(median(slowed_n[i]), most * median(steady_n[i]) + 0.3) << "N, from step " << felt.changes[i] << " on";
  }
  EXPECT_GT(felt_n, 1.0) << "nothing was felt at all";
}

INSTANTIATE_TEST_SUITE_P(Scenes, DilationFelt,
                         testing::Values(FeltClock{"press", {150, 400, 480, 800}}, FeltClock{"row", {100, 600, 1500}}),
                         [](const auto& one) { return std::string(one.param.scene); });
INSTANTIATE_TEST_SUITE_P(Full, DilationFelt, testing::Values(FeltClock{"heap", {150, 600, 1400}, true}),
                         [](const auto& one) { return std::string(one.param.scene); });

}  // namespace
}  // namespace subworld
