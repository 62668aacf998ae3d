#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>

namespace subworld {
namespace {

using test::config_of;
using test::TestDomain;
using test::until;

class WireStatus : public ::testing::TestWithParam<test::VendorPair> {
 protected:
  /// Takes statuses until one contains the text; that one, or nothing.
  static std::optional<Status> hear(Bus& bus, Reader<Status>& reader, const std::string& text) {
    Status status;
    const bool heard = until(
        bus,
        [&] {
          while (reader.take(status) == Take::sample) {
            if (status.text.find(text) != std::string::npos) return true;
          }
          return false;
        },
        5.0);
    return heard ? std::optional(status) : std::nullopt;
  }
};

// A paused loop updates nothing, and its thread may be publishing at that time.
TEST_P(WireStatus, notes_of_a_paused_loop_are_published) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto reader = receiver->reader<Status>();
  StatusBeacon beacon(*sender, ProgramKind::world_sim, 0, "test");
  for (int i = 0; i < 50; ++i) {
    const std::string said = "note " + std::to_string(i) + ".";
    // Fewer than the topic stores for a slow reader.
    std::thread busy([&] {
      for (int k = 0; k < 8; ++k) beacon.enter("busy");
    });
    beacon.note(said);
    busy.join();
    EXPECT_TRUE(hear(*receiver, reader, said)) << said;
    if (HasFailure()) break;
  }
}

// A note between two statuses, and a thread that wakes late, leave the rate as it is.
TEST_P(WireStatus, the_rate_is_that_of_the_time_that_has_passed) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto reader = receiver->reader<Status>();
  StatusBeacon beacon(*sender, ProgramKind::world_sim, 0, "test");
  const auto begin = std::chrono::steady_clock::now();
  double rate_hz = 0.0;
  std::uint64_t steps = 0;
  for (int tick = 0; tick < 80; ++tick) {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    steps = static_cast<std::uint64_t>(1000.0 * passed.count());
    beacon.update({.time_s = passed.count(), .steps = steps});
    if (tick % 10 == 0) beacon.note("note " + std::to_string(tick));
    Status status;
    while (reader.take(status) == Take::sample) rate_hz = status.rate_hz;
  }
  EXPECT_NEAR(rate_hz, 1000.0, 300.0) << "a busy machine delays the updates";
}

TEST_P(WireStatus, a_late_reader_gets_earlier_replies) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  StatusBeacon beacon(*sender, ProgramKind::world_sim, 0, "test");
  beacon.answer(7, {OrderState::done, "paused"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto replies = receiver->reader<ControlReply>();
  ControlReply reply;
  ASSERT_TRUE(test::eventually([&] { return replies.take(reply) == Take::sample; }));
  EXPECT_EQ(reply.number, 7U);
  EXPECT_EQ(reply.answer.outcome, OrderState::done);
  EXPECT_EQ(reply.answer.text, "paused");
}

TEST_P(WireStatus, says_as_data_whether_a_program_waits_or_is_paused) {
  const TestDomain held;
  const auto sender = open_bus(config_of(GetParam().first, held.number(), Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, held.number(), Mode::realtime));
  auto reader = receiver->reader<Status>();
  StatusBeacon beacon(*sender, ProgramKind::world_sim, 0, "test");
  beacon.pause(true);
  beacon.note("it waits", "haptic_sim 1");
  auto heard = hear(*receiver, reader, "it waits");
  ASSERT_TRUE(heard);
  EXPECT_TRUE(heard->paused);
  EXPECT_EQ(heard->waits_for, "haptic_sim 1");
  beacon.pause(false);
  beacon.note("anything else");
  heard = hear(*receiver, reader, "anything else");
  ASSERT_TRUE(heard);
  EXPECT_FALSE(heard->paused);
  EXPECT_EQ(heard->waits_for, "haptic_sim 1");
  beacon.note("it is there", "");
  heard = hear(*receiver, reader, "it is there");
  ASSERT_TRUE(heard);
  EXPECT_TRUE(heard->waits_for.empty());
}

TEST_P(WireStatus, an_order_reaches_a_reader_that_comes_later) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::lockstep));
  auto writer = sender->writer<Control>();
  Control order;
  order.number = 7;
  ASSERT_TRUE(writer.write(order));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto reader = receiver->reader<Control>();
  Control heard;
  ASSERT_TRUE(until(
      *receiver, [&] { return reader.take(heard) == Take::sample; }, 5.0));
  EXPECT_EQ(heard.number, 7U);
}

// It may run before the programs that worked with its predecessor have noticed: for them it is another one still.
TEST_P(WireStatus, a_program_that_was_started_again_is_another_one_until_it_takes_part) {
  const TestDomain held;
  const auto receiver = open_bus(config_of(GetParam().second, held.number(), Mode::lockstep));
  // Both from the start: Fast DDS gives a participant of this process the number of one that has closed.
  auto bus = open_bus(config_of(GetParam().first, held.number(), Mode::lockstep));
  const auto bus_of_second = open_bus(config_of(GetParam().first, held.number(), Mode::lockstep));
  auto reader = receiver->reader<Status>();
  StatusBeacon observer(*receiver, ProgramKind::device_sim, 0, "device");
  const auto is_replaced = [&] { return observer.is_replaced(ProgramKind::haptic_sim, 0); };
  constexpr double kSeveralStatuses_s = 2.5;
  const auto begin = [&](StatusBeacon& program) {
    program.note("is here");
    ASSERT_TRUE(hear(*receiver, reader, "is here"));
    observer.begins(ProgramKind::haptic_sim, 0, reader.sender_participant());
  };
  {
    StatusBeacon first(*bus, ProgramKind::haptic_sim, 0, "first");
    // What it said before it took part may come later.
    begin(first);
    first.enter("waiting");
    EXPECT_FALSE(test::eventually(is_replaced, kSeveralStatuses_s));
  }
  bus.reset();
  StatusBeacon second(*bus_of_second, ProgramKind::haptic_sim, 0, "second");
  second.enter("waiting");
  second.enter("running");
  ASSERT_TRUE(test::eventually(is_replaced));
  EXPECT_FALSE(test::eventually([&] { return !is_replaced(); }, kSeveralStatuses_s));
  begin(second);
  EXPECT_FALSE(test::eventually(is_replaced, kSeveralStatuses_s));
}

void expect_both_versions(const std::string& text, std::uint32_t other) {
  for (const std::uint32_t version : {other, kWireVersion})
    EXPECT_NE(text.find(std::to_string(version)), std::string::npos) << version << " is not in: " << text;
  EXPECT_NE(text.find("install the same version of Subworld on all hosts"), std::string::npos) << text;
}

TEST_P(WireStatus, a_program_of_another_version_is_named_once_and_not_counted_as_met) {
  constexpr std::uint32_t kOther = kWireVersion + 7;
  const TestDomain held;
  const auto sender = open_bus(config_of(GetParam().first, held.number(), Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, held.number(), Mode::realtime));
  StatusBeacon beacon(*receiver, ProgramKind::haptic_sim, 0, "test");
  auto reader = sender->reader<Status>();
  auto writer = sender->writer<Status>();
  Status foreign;
  foreign.wire_version = kOther;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer.write(foreign));
  const auto heard = hear(*sender, reader, "version");
  ASSERT_TRUE(heard);
  expect_both_versions(heard->text, kOther);
  EXPECT_EQ(heard->text.find("a program on this domain"), heard->text.rfind("a program on this domain"));
  EXPECT_FALSE(beacon.met(ProgramKind::world_sim, 0));
}

TEST_P(WireStatus, a_world_of_another_version_is_refused_with_both_versions) {
  constexpr std::uint32_t kOther = kWireVersion + 7;
  const TestDomain held;
  const auto sender = open_bus(config_of(GetParam().first, held.number(), Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, held.number(), Mode::realtime));
  auto writer = sender->writer<SceneDescription>();
  auto reader = receiver->reader<SceneDescription>();
  SceneDescription foreign;
  foreign.wire_version = kOther;
  foreign.session = 5;
  ASSERT_TRUE(writer.write(foreign));
  auto statuses = sender->writer<Status>();
  Status loading;
  loading.wire_version = kOther;
  ASSERT_TRUE(statuses.write(loading));
  const Scene scene;
  const StatusBeacon beacon(*receiver, ProgramKind::haptic_sim, 0, "haptic_sim 0");
  SessionFinder finder(reader, scene, beacon);
  std::string refusal;
  ASSERT_TRUE(until(*receiver, [&] {
    try {
      EXPECT_FALSE(finder.look(held.number())) << "joined";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      refusal = error.what();
    }
    return !refusal.empty();
  }));
  expect_both_versions(refusal, kOther);
  EXPECT_EQ(finder.session(), 0U);
}

TEST_P(WireStatus, a_scene_counts_only_if_its_program_is_a_world) {
  const TestDomain held;
  const auto sender = open_bus(config_of(GetParam().first, held.number(), Mode::realtime));
  const auto foreign = open_bus(config_of(GetParam().first, held.number(), Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, held.number(), Mode::realtime));
  auto foreign_scenes = foreign->writer<SceneDescription>();
  auto scenes = sender->writer<SceneDescription>();
  auto reader = receiver->reader<SceneDescription>();
  const Scene scene;
  const StatusBeacon beacon(*receiver, ProgramKind::haptic_sim, 0, "haptic_sim 0");
  SessionFinder finder(reader, scene, beacon);
  SceneDescription description;
  description.name = scene.name;
  description.settings = agreed_settings(scene);
  description.session = 5;
  ASSERT_TRUE(scenes.write(description));
  // It fits better than the world's own, and comes last.
  description.session = 7;
  ASSERT_TRUE(until(*receiver, [&] {
    EXPECT_TRUE(foreign_scenes.write(description));
    EXPECT_FALSE(finder.look(held.number()));
    return reader.matched() == 2;
  }));
  StatusBeacon world(*sender, ProgramKind::world_sim, 0, "world_sim");
  world.enter("loading");
  ASSERT_TRUE(until(*receiver, [&] {
    EXPECT_TRUE(foreign_scenes.write(description));
    return finder.look(held.number());
  }));
  EXPECT_EQ(finder.session(), 5U);
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireStatus, test::kMixedPairs, test::name_of_pair);
INSTANTIATE_TEST_SUITE_P(Full, WireStatus, test::kEqualPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
