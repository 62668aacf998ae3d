// When users take part in a run in lock-step, and what a sub-world makes of a device that falls silent and comes back.
#include "haptic_sim/lockstep_order.hpp"
#include "lab/session/coupled_run.hpp"
#include "model/error.hpp"
#include "model/settings/presence.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

namespace subworld {
namespace {

std::vector<PresenceEvent> parsed(const std::string& text) {
  std::vector<PresenceEvent> events;
  EXPECT_EQ(parse_presence(text, events), "");
  return events;
}

Scene two_users() {
  Scene scene = load_scene(std::string(SCENES_FOLDER) + "/lift.yaml");
  keep_users(scene, 2);
  return scene;
}

TEST(Presence, is_read_and_written) {
  const std::string text = "1 joins 0.5, 0 leaves 1.25, 0 joins 2, 0 misses 1 from 0.125 to 0.5, 1 misses 0 from 1.25";
  const auto events = parsed(text);
  EXPECT_EQ(to_text(events), text);
  EXPECT_EQ(presence_fault(events, 2), "");
  EXPECT_FALSE(takes_part(events, 1, 0.4));
  EXPECT_TRUE(takes_part(events, 1, 0.5));
  EXPECT_TRUE(takes_part(events, 0, 0.0));
  EXPECT_FALSE(takes_part(events, 0, 1.5));
  EXPECT_TRUE(takes_part(events, 0, 3.0));
  EXPECT_TRUE(takes_part(events, 2, 3.0));
  EXPECT_EQ(returns(events, 0), 1);
  EXPECT_EQ(returns(events, 1), 0);
  EXPECT_TRUE(misses(events, 0, 1, 0.2));
  EXPECT_FALSE(misses(events, 0, 1, 0.5));
  EXPECT_TRUE(misses(events, 1, 0, 99.0));
}

TEST(Presence, has_orders_that_are_due_once) {
  const std::string text =
      "world engine ode fast from 0.5, 1 joins 0.5, 0 engine bullet quality from 0.625, world ratio 4-8 from 0.5, "
      "world ratio 5 from 1, world stops 1.5";
  const auto events = parsed(text);
  EXPECT_EQ(to_text(events), text);
  EXPECT_EQ(presence_fault(events, 2), "");
  EXPECT_NE(presence_fault(parsed("2 engine ode fast from 3"), 2).find("there is no user 2"), std::string::npos);
  const auto due = [&](int user, double from_s, double to_s) {
    return to_text(due_orders(events, user, from_s, to_s));
  };
  EXPECT_EQ(due(kWorld, 0.498, 0.502), "world engine ode fast from 0.5, world ratio 4-8 from 0.5");
  EXPECT_EQ(due(kWorld, 0.502, 0.506), "");
  EXPECT_EQ(due(kWorld, 1.4, 1.5), "world stops 1.5");
  EXPECT_EQ(due(0, -1.0, 9.0), "0 engine bullet quality from 0.625");
  EXPECT_EQ(due(1, -1.0, 9.0), "");
  EXPECT_TRUE(takes_part(events, 0, 0.0)) << "an order is no absence";
  EXPECT_EQ(returns(events, 0), 0);
  EXPECT_EQ(lacking_events(text, "1 joins 0.5, world ratio 4-8 from 0.5, world ratio 5 from 1, world stops 1.5"),
            "world engine ode fast from 0.5, 0 engine bullet quality from 0.625");
  EXPECT_EQ(lacking_events(text, ""), text);
  EXPECT_EQ(lacking_events("", text), "");
}

TEST(Presence, names_what_is_wrong) {
  std::vector<PresenceEvent> events;
  for (const char* text :
       {"", "1", "1 joins", "1 comes 3", "-1 joins 3", "1 joins -3", "1 joins nan", "1 joins 3 4", "0 misses 1 4",
        "0 misses 1 from 4 to 3", "1 joins 3,", "world joins 3", "0 ratio 4-8 from 3", "0 engine ode from 3",
        "world engine ode fast 3", "world ratio 4 from -1", "x engine ode fast from 3", "0 stops 3", "world stops"})
    EXPECT_NE(parse_presence(text, events).find("is no event"), std::string::npos) << text;
  EXPECT_NE(presence_fault(parsed("1 joins 3, 1 joins 4"), 2).find("in turn"), std::string::npos);
  EXPECT_NE(presence_fault(parsed("1 leaves 3, 1 joins 3"), 2).find("in turn"), std::string::npos);
  EXPECT_NE(presence_fault(parsed("2 joins 3"), 2).find("there is no user 2"), std::string::npos);
}

TEST(Presence, of_one_who_leaves_at_once_is_not_recorded) {
  using Kind = PresenceEvent::Kind;
  std::vector<PresenceEvent> events;
  record(events, Kind::leaves, 1, 0.5);
  record(events, Kind::joins, 1, 0.75);
  record(events, Kind::joins, 2, 0.75);
  record(events, Kind::leaves, 1, 0.75);
  EXPECT_EQ(to_text(events), "1 leaves 0.5, 2 joins 0.75");
  record(events, Kind::leaves, 2, 1.0);
  EXPECT_EQ(to_text(events), "1 leaves 0.5, 2 joins 0.75, 2 leaves 1");
}

TEST(Presence, has_one_interval_where_several_reports_tell_of_missed_states) {
  std::vector<PresenceEvent> events;
  record_missed(events, 1, {0, 0.5, 0.504});
  record_missed(events, 0, {1, 0.504, 0.508});
  record_missed(events, 1, {0, 0.504, 0.508});
  record_missed(events, 1, {0, 0.512, 0.516});
  EXPECT_EQ(to_text(events),
            "1 misses 0 from 0.5 to 0.508, 0 misses 1 from 0.504 to 0.508, 1 misses 0 from 0.512 to 0.516");
}

TEST(Presence, is_refused_where_all_users_are_in_one_process) {
  Scene scene = two_users();
  scene.settings.presence = parsed("1 joins 0.5");
  EXPECT_THROW(CoupledRun run(scene), Error);
}

class LostDevice : public testing::Test {
 protected:
  static DeviceState state(double at_s) {
    DeviceState state;
    state.stamp_s = at_s;
    state.sender = 1;
    return state;
  }
  /// A sub-world that needs the device, and begins with a step.
  void begin(std::uint64_t step) {
    order_.emplace(scene_, 0, 0, step);
    ASSERT_TRUE(world_.settle([](double) { return true; }));
    SubWorld other(scene_, 1);
    for (SubWorld* sub : {&sub_, &other}) {
      (void)sub->synchronise_with(world_.frame(sub == &other ? 1 : 0));
      ASSERT_TRUE(world_.receive(HapticReport(*sub->close_cycle(1))));
    }
    world_.step();
    (void)sub_.synchronise_with(world_.frame(0));
    ASSERT_NE(sub_.facts().peers & 2U, 0U);
  }
  void step_to(std::uint64_t step) {
    while (order_->next_step() < step) {
      const double at_s = scene_.settings.h_s * static_cast<double>(order_->next_step());
      order_->step(
          sub_, state(at_s), [](const DeviceCommand&, const FeltStep&) {}, [this] { (void)sub_.close_cycle(0); });
    }
  }
  std::string missed() {
    std::vector<PresenceEvent> events;
    const std::vector<MissedStates> taken = order_->take_missed();
    EXPECT_LE(taken.size(), 1U) << "steps that follow each other are one interval of a report";
    for (const MissedStates& one : taken) record_missed(events, 0, one);
    return to_text(events);
  }
  Scene scene_ = two_users();
  World world_{scene_};
  SubWorld sub_{scene_, 0};
  std::optional<LockstepOrder> order_;
};

TEST_F(LostDevice, is_missed_from_its_last_state_to_the_first_of_another_process) {
  begin(0);
  for (int step = 0; step < 5; ++step) order_->hear(1, state(0.001 * step));
  EXPECT_EQ(order_->heard(1), 5U);
  step_to(5);
  order_->miss(1);
  step_to(10);
  EXPECT_EQ(missed(), "0 misses 1 from 0.005 to 0.01");
  DeviceState another = state(0.0);
  another.sender = 2;
  EXPECT_TRUE(order_->is_replaced(1, another));
  order_->hear(1, another);  // it does not know the time yet
  EXPECT_EQ(order_->heard(1), 5U);
  step_to(20);
  another.stamp_s = 0.02;
  another.sequence = 1;
  EXPECT_FALSE(order_->is_replaced(1, another));
  order_->hear(1, another);
  EXPECT_EQ(order_->heard(1), 21U);
  step_to(21);
  EXPECT_EQ(missed(), "0 misses 1 from 0.01 to 0.02") << "what was missed since the last report";
}

// The first process has sent states of steps from which the second one sends.
TEST_F(LostDevice, is_another_one_also_where_no_step_is_missed) {
  LockstepOrder order(scene_, 0);
  for (int step = 0; step < 5; ++step) order.hear(1, state(0.001 * step));
  DeviceState another = state(0.002);
  another.sender = 2;
  another.sequence = 1;
  EXPECT_TRUE(order.is_of_another(1, another)) << "it counts once the world lets it take part";
  EXPECT_FALSE(order.is_of_another(1, state(0.005)));
  order.hear(1, another);
  EXPECT_EQ(order.heard(1), 3U);
  EXPECT_EQ(order.known_of(1), nullptr) << "the next step is step 0";
  LockstepOrder later(scene_, 0, 1, 4);
  later.hear(1, state(0.004));
  later.hear(1, state(0.005));
  another.stamp_s = 0.004;
  later.hear(1, another);
  ASSERT_NE(later.known_of(1), nullptr);
  EXPECT_EQ(later.known_of(1)->sender, 2U);
}

TEST_F(LostDevice, is_heard_from_the_step_in_which_a_sub_world_begins) {
  begin(20);
  for (int step = 15; step < 20; ++step) order_->hear(1, state(0.001 * step));
  EXPECT_EQ(order_->heard(1), 20U);
  order_->hear(1, state(0.02));
  EXPECT_EQ(order_->heard(1), 21U);
  step_to(21);
  EXPECT_EQ(missed(), "");
}

// It was only slow: what came meanwhile stays missed, so that the record is true.
TEST_F(LostDevice, is_heard_again_from_the_step_at_which_the_sub_world_is) {
  begin(0);
  order_->hear(1, state(0.0));
  order_->miss(1);
  step_to(3);
  order_->hear_again(1);
  for (int step = 1; step < 5; ++step) order_->hear(1, state(0.001 * step));
  step_to(5);
  EXPECT_EQ(missed(), "0 misses 1 from 0 to 0.003");
}

TEST(DelayLine, that_begins_in_the_middle_of_a_run_has_its_first_message_at_once_and_none_of_before) {
  Settings settings;
  settings.delay.from_device_s = 0.003;
  DelayLine<int> line(settings, Direction::from_device, 0, 100);
  std::vector<int> arrived;
  for (int step = 100; step < 106; ++step) arrived.push_back(line.pass(step, static_cast<std::uint64_t>(step)));
  EXPECT_EQ(arrived, (std::vector<int>{100, 100, 100, 100, 101, 102}));
}

TEST_F(LostDevice, is_missed_again_where_the_record_says_so) {
  scene_.settings.presence = parsed("0 misses 1 from 0.003 to 0.006");
  begin(0);
  for (int step = 0; step < 10; ++step) {
    order_->hear(1, state(0.001 * step));
    step_to(static_cast<std::uint64_t>(step) + 1);
  }
  EXPECT_EQ(order_->heard(1), 10U);
  EXPECT_EQ(missed(), "0 misses 1 from 0.003 to 0.006");
}

}  // namespace
}  // namespace subworld
