// Users who leave the world, return to it, and start anew with it.
#include "device_sim/emulated_device.hpp"
#include "haptic_sim/sub_world.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <vector>

namespace subworld {
namespace {

/// World, sub-worlds and devices in one process, without delay. Users come and go.
class ComeAndGo {
 public:
  explicit ComeAndGo(const std::string& name) : scene(load(name)), world(std::make_unique<World>(scene)) {
    world->settle([](double) { return true; });
    for (std::size_t u = 0; u < static_cast<std::size_t>(scene.settings.users); ++u) {
      users_.push_back(
          {std::make_unique<SubWorld>(scene, u), EmulatedDevice(scene.users[u].device, static_cast<std::uint32_t>(u))});
      (void)users_[u].sub->synchronise_with(world->frame(u));
      EXPECT_TRUE(world->receive(HapticReport(*users_[u].sub->close_cycle(1))));
    }
  }

  /// Until this time, s.
  void run(double until_s) {
    while (world->facts().time_s < until_s - 1e-9) cycle();
  }
  void cycle() {
    for (std::size_t u = 0; u < users_.size(); ++u) {
      if (users_[u].sub != nullptr) step(u);
    }
    world->step();
    for (std::size_t u = 0; u < users_.size(); ++u) {
      if (users_[u].sub != nullptr) (void)users_[u].sub->synchronise_with(world->frame(u));
    }
    most_kinetic_j = std::max(most_kinetic_j, world->facts().kinetic_j);
  }
  /// The process of a user dies; the device stays.
  void kill(std::size_t user) {
    users_[user].sub.reset();
    world->leave(user);
  }
  /// Another process begins with the newest frame; its reports are late by some cycles.
  void start(std::size_t user, std::size_t late_cycles = 0) {
    users_[user].late_cycles = late_cycles;
    users_[user].reports.clear();
    users_[user].sub = std::make_unique<SubWorld>(scene, user);
    EXPECT_TRUE(users_[user].sub->reset_from(world->frame(user)));
  }
  /// The world dies, and goes on from a checkpoint of this stamp. Its users wait.
  void resume_world() {
    WorldCheckpoint saved;
    saved.devices.resize(users_.size());
    copy_accounts(*world, saved);
    for (const Body& body : scene.bodies) {
      saved.states.push_back(world->engine().state(body.id));
      saved.asleep.push_back(world->engine().asleep(body.id) ? 1 : 0);
    }
    const Scene resumed = resumed_scene(scene, saved);
    scene = resumed;  // in place: the sub-worlds refer to its parts
    world = std::make_unique<World>(scene);
    world->resume(saved);
  }
  /// The world dies, and another one begins at t = 0. The processes of its users have survived.
  void begin_world_anew() {
    world = std::make_unique<World>(scene);
    world->settle([](double) { return true; });
    for (User& user : users_) EXPECT_TRUE(user.sub->reset_from(world->frame(&user - users_.data())));
    for (User& user : users_) EXPECT_TRUE(world->receive(HapticReport(*user.sub->close_cycle(1))));
  }
  [[nodiscard]] SubWorld& sub(std::size_t user) { return *users_[user].sub; }
  /// Largest step of the force on an operator since the last call, N.
  [[nodiscard]] double take_largest_step_n(std::size_t user) { return std::exchange(users_[user].largest_step_n, 0.0); }
  [[nodiscard]] Vec3 force(std::size_t user) const { return users_[user].force; }
  [[nodiscard]] bool accepts_reports() const { return accepted_; }

  Scene scene;
  std::unique_ptr<World> world;
  double most_kinetic_j = 0.0;

 private:
  struct User {
    std::unique_ptr<SubWorld> sub;
    EmulatedDevice device;
    Vec3 force = Vec3::Zero();
    double largest_step_n = 0.0;
    std::size_t late_cycles = 0;
    std::deque<HapticReport> reports{};  ///< that are under way
  };
  static Scene load(const std::string& name) {
    Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
    keep_users(scene, static_cast<int>(scene.users.size()));
    scene.settings.disable(disabled(Optimisation::suppression));  // every cycle has its messages, as in real time
    return scene;
  }
  void step(std::size_t number) {
    User& user = users_[number];
    const double h = scene.settings.h_s;
    for (int i = 0; i < scene.settings.ratio; ++i) {
      const DeviceState state = user.device.state();
      const auto send = [&](const FeltStep& felt) {
        const Vec3 before = std::exchange(user.force, felt.to_operator.force);
        user.largest_step_n = std::max(user.largest_step_n, (user.force - before).norm());
        user.device.step(user.sub->command_for(state, felt.to_operator), h);
      };
      (void)user.sub->step({.device = &state, .wall_s = h, .dt = h}, send,
                           [&] { user.reports.push_back(*user.sub->close_cycle(1)); });
    }
    for (; user.reports.size() > user.late_cycles; user.reports.pop_front())
      accepted_ = world->receive(std::move(user.reports.front())) && accepted_;
  }

  std::vector<User> users_;
  bool accepted_ = true;
};

double height_m(const World& world, const Scene& scene) {
  double highest_m = 0.0;
  for (const Body& body : scene.bodies) {
    if (body.fixed() || std::ranges::find(scene.users, body.id, &UserSpec::proxy) != scene.users.end()) continue;
    highest_m = std::max(highest_m, world.engine().state(body.id).position.z());
  }
  return highest_m;
}

// Two operators have lifted a cube between them; one process dies.
class Lifted : public testing::Test {
 protected:
  Lifted() : run_("lift") {
    run_.run(2.1);  // the devices stand from 2 s on
    lifted_m_ = height_m(*run_.world, run_.scene);
    (void)run_.take_largest_step_n(0);
    run_.most_kinetic_j = 0.0;
  }
  [[nodiscard]] double height() const { return height_m(*run_.world, run_.scene); }

  ComeAndGo run_;
  double lifted_m_ = 0.0;
};

TEST_F(Lifted, TheCubeIsHeldWhileAUserIsAbsentAndTheOtherFeelsNoStep) {
  run_.kill(1);
  EXPECT_TRUE(run_.world->user_facts(1).absent);
  run_.run(2.6);
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  EXPECT_LT(run_.take_largest_step_n(0), 0.3);
  EXPECT_LT(run_.world->facts().energy_excess_j, 0.01);
}

TEST_F(Lifted, AUserWhoReturnsBeginsAtZeroForceAndGoesOnLifting) {
  run_.kill(1);
  run_.run(2.4);
  run_.start(1);
  (void)run_.take_largest_step_n(1);
  run_.cycle();
  EXPECT_FALSE(run_.world->user_facts(1).absent);
  EXPECT_LT(run_.force(1).norm(), 0.1 * run_.force(0).norm()) << "not from zero";
  run_.run(3.0);
  EXPECT_TRUE(run_.accepts_reports());
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  EXPECT_GT(run_.force(1).norm(), 0.5 * run_.force(0).norm()) << "the coupling has lost its stretch";
  EXPECT_LT(run_.take_largest_step_n(0), 0.3);
  EXPECT_LT(run_.most_kinetic_j, 0.05);
  EXPECT_LT(run_.world->facts().energy_excess_j, 0.01);
}

// The world has to guess then, and must not make up for the time of the absence.
TEST_F(Lifted, AUserWhoReturnsWithLateReportsMovesNothing) {
  run_.kill(1);
  run_.run(2.4);
  run_.start(1, 3);
  run_.run(2.6);
  EXPECT_FALSE(run_.world->user_facts(1).absent);
  EXPECT_LT(run_.take_largest_step_n(0), 0.3);
  EXPECT_LT(run_.most_kinetic_j, 2e-4);
}

TEST_F(Lifted, AResumedWorldHoldsTheCubeAndItsUsersRejoinWithoutAStep) {
  run_.resume_world();
  for (int i = 0; i < 50; ++i) run_.world->step();
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  for (const std::size_t u : {0U, 1U}) EXPECT_TRUE(run_.sub(u).reset_from(run_.world->frame(u)));
  run_.run(3.0);
  EXPECT_TRUE(run_.accepts_reports());
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  EXPECT_LT(run_.most_kinetic_j, 2e-4);
  EXPECT_LT(run_.world->facts().energy_excess_j, 0.01);
  for (const std::size_t u : {0U, 1U}) EXPECT_GT(run_.force(u).norm(), 5.0) << u;
}

TEST_F(Lifted, AWorldThatBeginsAnewCountsFromThere) {
  run_.begin_world_anew();
  EXPECT_EQ(run_.world->user_facts(0).impulse.force.norm(), 0.0);
  run_.run(0.5);
  EXPECT_TRUE(run_.accepts_reports());
  EXPECT_LT(run_.world->facts().energy_excess_j, 0.01);
}

TEST_F(Lifted, ReportsOfBeforeTheAbsenceAreRefused) {
  HapticReport late = *run_.sub(1).close_cycle(1);
  run_.kill(1);
  run_.cycle();
  late.stamp = run_.world->facts().stamp + 1;
  late.stamp_s = run_.scene.settings.h_s * run_.scene.settings.ratio * static_cast<double>(late.stamp);
  HapticReport fresh = late;
  EXPECT_FALSE(run_.world->receive(std::move(late)));
  fresh.started_stamp = run_.world->facts().stamp;
  EXPECT_TRUE(run_.world->receive(std::move(fresh)));
}

// The network loses everything for a while, and the sub-world goes on meanwhile.
TEST_F(Lifted, ASubWorldThatFellBehindStartsAnewWithoutCreatingEnergy) {
  const HapticReport before = *run_.sub(1).close_cycle(1);
  run_.world->hold(0);
  run_.world->hold(1);
  for (int i = 0; i < 40; ++i) run_.world->step();
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  for (const std::size_t u : {0U, 1U}) EXPECT_TRUE(run_.sub(u).reset_from(run_.world->frame(u)));
  run_.run(run_.world->facts().time_s + 0.5);
  EXPECT_TRUE(run_.accepts_reports());
  EXPECT_GT(height(), lifted_m_ - 0.03) << "it fell";
  EXPECT_LT(run_.most_kinetic_j, 0.05);
  EXPECT_LT(run_.world->facts().energy_excess_j, 0.01);
}

TEST(EmulatedDevice, ThatIsResumedGoesOnOnItsPathFromWhereItIs) {
  const Scene scene = load_scene(std::string(SCENES_FOLDER) + "/lift.yaml");
  EmulatedDevice device(scene.users[0].device, 0);
  EmulatedDevice whole(scene.users[0].device, 0);
  for (int i = 0; i < 1500; ++i) whole.step({}, 0.001);
  device.resume_at(1.5);
  EXPECT_LT(device.state().pose.position.norm(), 1e-12) << "it jumps";
  EXPECT_DOUBLE_EQ(device.state().stamp_s, 1.5);
  const Vec3 before = whole.state().pose.position;
  for (int i = 0; i < 200; ++i) {
    device.step({}, 0.001);
    whole.step({}, 0.001);
  }
  EXPECT_LT((device.state().pose.position - (whole.state().pose.position - before)).norm(), 1e-9);
  EXPECT_GT(device.state().pose.position.norm(), 0.01);
}

// A proxy that has turned meanwhile keeps its orientation: that of the device is measured from there.
TEST(Declutch, PlacedDevicesMoveAndTurnFromThere) {
  BodyState start;
  start.position = {0.1, 0.0, 0.0};
  Declutch declutch(start);
  DeviceState device;
  device.pose.position = {1.0, 2.0, 3.0};
  declutch.follow(device, 1.0);
  const Quat quarter(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitZ()));
  declutch.place({{0.5, 0.5, 0.5}, quarter});
  device.pose.position = {2.0, 2.0, 2.0};
  device.pose.orientation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitX()));
  declutch.follow(device, 1.0);
  EXPECT_LT((declutch.device().pose.position - Vec3(0.5, 0.5, 0.5)).norm(), 1e-12);
  EXPECT_LT(declutch.device().pose.orientation.angularDistance(quarter), 1e-6);
  device.pose.position += Vec3(0.0, 0.0, 0.1);
  device.pose.orientation = Quat(Eigen::AngleAxisd(0.4, Vec3::UnitX()));
  declutch.follow(device, 1.0);
  EXPECT_LT((declutch.device().pose.position - Vec3(0.5, 0.5, 0.6)).norm(), 1e-12);
  const Quat turned = Quat(Eigen::AngleAxisd(0.1, Vec3::UnitX())) * quarter;
  EXPECT_LT(declutch.device().pose.orientation.angularDistance(turned), 1e-6);
}

}  // namespace
}  // namespace subworld
