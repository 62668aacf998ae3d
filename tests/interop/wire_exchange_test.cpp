#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "support/wire_samples.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace subworld {
namespace {

using test::config_of;
using test::numbers_of;
using test::SampleMaker;
using test::TestDomain;
using test::until;

class WireExchange : public ::testing::TestWithParam<test::VendorPair> {
 protected:
  void open(Mode mode = Mode::lockstep) {
    sender = open_bus(config_of(GetParam().first, domain_.number(), mode));
    receiver = open_bus(config_of(GetParam().second, domain_.number(), mode));
  }

  template <class M>
  ::testing::AssertionResult connected(const Writer<M>& writer, const Reader<M>& reader) {
    const bool met = until(*receiver, [&] { return writer.matched() > 0 && reader.matched() > 0; });
    return met ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << kTopicOf<M>.name << " did not match";
  }

  template <class M>
  void exchange() {
    auto writer = sender->writer<M>();
    auto reader = receiver->reader<M>();
    ASSERT_TRUE(connected(writer, reader));
    SampleMaker make(static_cast<std::uint32_t>(GetParam().first) + 3);
    for (int i = 0; i < 20; ++i) {
      const M sent = make.make<M>();
      ASSERT_TRUE(writer.write(sent)) << kTopicOf<M>.name;
      M received;
      Take taken = Take::none;
      ASSERT_TRUE(until(*receiver, [&] { return (taken = reader.take(received)) != Take::none; })) << kTopicOf<M>.name;
      ASSERT_EQ(taken, Take::sample) << kTopicOf<M>.name;
      ASSERT_EQ(numbers_of(sent), numbers_of(received)) << kTopicOf<M>.name;
    }
    EXPECT_TRUE(writer.wait_for_acknowledgments(20.0)) << kTopicOf<M>.name;
    EXPECT_GT(writer.sent_bytes(), 0U);
    EXPECT_GE(reader.received_bytes(), writer.sent_bytes());
    EXPECT_LT(reader.received_bytes(), writer.sent_bytes() + 20 * 4);
  }

  const TestDomain domain_;
  std::unique_ptr<Bus> sender;
  std::unique_ptr<Bus> receiver;
};

TEST_P(WireExchange, every_topic_arrives_as_it_was_sent) {
  open();
  exchange<SceneDescription>();
  exchange<DeviceState>();
  exchange<DeviceCommand>();
  exchange<WorldFrame>();
  exchange<HapticReport>();
  exchange<WorldSnapshot>();
  exchange<Control>();
  exchange<Status>();
  EXPECT_EQ(receiver->events().rejected, 0U);
  EXPECT_EQ(receiver->events().lost, 0U);
}

TEST_P(WireExchange, partitions_separate_users_and_a_star_reads_all) {
  open();
  auto first = sender->writer<WorldFrame>("user0");
  auto second = sender->writer<WorldFrame>("user1");
  auto only_first = receiver->reader<WorldFrame>("user0");
  auto all = receiver->reader<WorldFrame>("*");
  ASSERT_TRUE(until(
      *receiver,
      [&] { return first.matched() == 2 && second.matched() == 1 && only_first.matched() == 1 && all.matched() == 2; }))
      << first.matched() << second.matched() << only_first.matched() << all.matched();

  WorldFrame frame;
  for (std::uint32_t user = 0; user < 2; ++user) {
    frame.user = UserId{user};
    frame.stamp = 100 + user;
    ASSERT_TRUE((user == 0 ? first : second).write(frame));
  }
  std::uint64_t stamps = 0;
  int taken = 0;
  ASSERT_TRUE(until(*receiver, [&] {
    while (all.take(frame) == Take::sample) {
      stamps += frame.stamp;
      ++taken;
    }
    return taken == 2;
  }));
  EXPECT_EQ(stamps, 201U);
  ASSERT_TRUE(until(*receiver, [&] { return only_first.take(frame) == Take::sample; }));
  EXPECT_EQ(frame.stamp, 100U);
  EXPECT_EQ(only_first.take(frame), Take::none);
}

TEST_P(WireExchange, keys_are_instances_in_real_time_each_keeps_its_newest) {
  open(Mode::realtime);
  auto writer = sender->writer<Status>();
  auto reader = receiver->reader<Status>();
  ASSERT_TRUE(connected(writer, reader));
  // 3 x 16 samples fit only if the four keys are separate instances: one instance stores 16.
  Status status;
  // A volatile reader may miss the first ones.
  status.instance = 63;
  ASSERT_TRUE(until(*receiver, [&] { return writer.write(status) && reader.take(status) == Take::sample; }));
  ASSERT_TRUE(writer.wait_for_acknowledgments(20.0));
  while (reader.take(status) != Take::none) {
  }
  for (std::uint64_t step = 0; step < 12; ++step) {
    for (std::uint32_t key = 0; key < 4; ++key) {
      status.program = static_cast<ProgramKind>(key % 2);
      status.instance = key / 2;
      status.steps = step;
      ASSERT_TRUE(writer.write(status));
    }
  }
  ASSERT_TRUE(writer.wait_for_acknowledgments(20.0));
  std::array<std::uint64_t, 4> next{};
  int taken = 0;
  ASSERT_TRUE(until(*receiver, [&] {
    while (reader.take(status) == Take::sample) {
      const std::size_t key = 2 * status.instance + static_cast<std::size_t>(status.program);
      EXPECT_EQ(status.steps, next.at(key)++);
      ++taken;
    }
    return taken == 48;
  })) << taken;
}

TEST_P(WireExchange, a_late_joiner_gets_a_scene_of_two_megabytes) {
  const TestDomain held;
  const int domain = held.number();
  sender = open_bus(config_of(GetParam().first, domain));
  auto writer = sender->writer<SceneDescription>();
  SceneDescription scene = SampleMaker(5).make<SceneDescription>();
  SampleMaker make(6);
  scene.bodies.resize(8000);
  scene.states.resize(8000);
  for (Body& body : scene.bodies) {
    make.fill(body);
    body.shape.mesh = 0;
    body.name = "a body with a rather long name";
  }
  for (BodyState& state : scene.states) make.fill(state);
  ASSERT_TRUE(writer.write(scene));
  EXPECT_GT(writer.sent_bytes(), 2'000'000U);

  receiver = open_bus(config_of(GetParam().second, domain));
  auto reader = receiver->reader<SceneDescription>();
  SceneDescription received;
  ASSERT_TRUE(until(*receiver, [&] { return reader.take(received) == Take::sample; }));
  EXPECT_EQ(numbers_of(scene), numbers_of(received));
}

TEST_P(WireExchange, ten_thousand_frames_in_lockstep_are_neither_lost_nor_doubled_nor_reordered) {
  open();
  auto writer = sender->writer<WorldFrame>("user0");
  auto reader = receiver->reader<WorldFrame>("user0");
  ASSERT_TRUE(connected(writer, reader));
  constexpr std::uint64_t kFrames = 10'000;
  std::thread sending([&] {
    SampleMaker make(23);
    auto frame = make.make<WorldFrame>();
    frame.user = UserId{0};
    frame.states.resize(4);
    for (auto& state : frame.states) make.fill(state);
    for (frame.stamp = 0; frame.stamp < kFrames; ++frame.stamp) {
      ASSERT_TRUE(writer.write(frame)) << frame.stamp;
    }
  });
  WorldFrame frame;
  std::uint64_t expected = 0;
  const bool all = until(
      *receiver,
      [&] {
        while (expected < kFrames && reader.take(frame) == Take::sample && frame.stamp == expected) ++expected;
        return expected == kFrames;
      },
      40.0);
  sending.join();
  EXPECT_TRUE(all) << "stopped at " << expected << ", frame " << frame.stamp;
  EXPECT_EQ(reader.take(frame), Take::none);
}

TEST_P(WireExchange, in_lockstep_the_first_frame_arrives_whenever_it_is_written) {
  const TestDomain held;
  const int domain = held.number();
  sender = open_bus(config_of(GetParam().first, domain));
  receiver = open_bus(config_of(GetParam().second, domain));
  auto writer = sender->writer<WorldFrame>();
  auto reader = receiver->reader<WorldFrame>();
  WorldFrame frame;
  for (frame.stamp = 0; frame.stamp < 10; ++frame.stamp) ASSERT_TRUE(writer.write(frame));
  for (std::uint64_t expected = 0; expected < 10; ++expected) {
    ASSERT_TRUE(until(*receiver, [&] { return reader.take(frame) == Take::sample; })) << expected;
    ASSERT_EQ(frame.stamp, expected);
  }
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireExchange, test::kAllPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
