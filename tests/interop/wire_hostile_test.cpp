#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "support/wire_samples.hpp"
#include "wire/bus.hpp"
#include "wire/codec/codec.hpp"
#include "wire/plugin.hpp"

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace subworld {
namespace {

using test::config_of;
using test::SampleMaker;
using test::until;
using Bytes = std::vector<std::uint8_t>;

/// What a raw back end reports is of no interest.
class NoEvents final : public wire::EventSink {
 public:
  void report(wire::Event, std::uint64_t, const char*, const char*, const char*) noexcept override {}
  void wake() noexcept override {}
};

class WireHostile : public ::testing::TestWithParam<test::VendorPair> {
 protected:
  Bytes random_bytes(std::size_t size) {
    Bytes bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random_());
    return bytes;
  }

  /// Some bytes changed, or the end cut off.
  Bytes damaged(std::span<const std::uint8_t> genuine) {
    Bytes bytes(genuine.begin(), genuine.end());
    for (int i = 0; i < 3; ++i) bytes[random_() % bytes.size()] = static_cast<std::uint8_t>(random_());
    if (random_() % 3 == 0) bytes.resize(random_() % bytes.size());
    return bytes;
  }

  /// Random and damaged bytes as samples of the topic; then a genuine sample arrives.
  template <class M>
  void send_rubbish(wire::Backend& rubbish) {
    SCOPED_TRACE(kTopicOf<M>.name);
    auto reader = receiver_->reader<M>();
    auto writer = sender_->writer<M>();
    const auto raw = rubbish.create_writer({kTopicOf<M>, qos_of(kTopicOf<M>, Mode::realtime, 0.001, 0.004), ""});
    ASSERT_TRUE(until(*receiver_, [&] { return raw->matched() > 0 && reader.matched() == 2; }));
    const std::size_t key_end = 4 + 4 * kTopicOf<M>.key_words;
    const auto rejected_before = receiver_->events().rejected;
    SampleMaker make(4);
    Codec<M> codec;
    M sample = make.make<M>();
    for (int i = 0; i < 300; ++i) {
      Bytes bytes = i % 2 == 0 ? random_bytes(random_() % 600) : damaged(codec.encode(sample));
      // A reader has room for a limited number of keys, so these stay few.
      for (std::size_t at = 0; at < std::min(key_end, bytes.size()); ++at) bytes[at] &= 1U;
      raw->write(bytes);
      for (int most = 0; most < 100 && reader.take(sample) != Take::none; ++most) {
      }
      sample = make.make<M>();
    }
    // All of a burst of best effort may be lost.
    EXPECT_TRUE(until(*receiver_, [&] {
      raw->write(Bytes(100, 0));
      while (reader.take(sample) != Take::none) {
      }
      return receiver_->events().rejected > rejected_before;
    }));
    expect_genuine(writer, reader);
  }

  template <class M>
  void expect_genuine(Writer<M>& writer, Reader<M>& reader) {
    SampleMaker make(9);
    const M sent = make.make<M>();
    const auto numbers = test::numbers_of(sent);
    EXPECT_TRUE(until(*receiver_, [&] {
      EXPECT_TRUE(writer.write(sent));
      M received;
      for (Take taken = reader.take(received); taken != Take::none; taken = reader.take(received)) {
        if (taken == Take::sample && test::numbers_of(received) == numbers) return true;
      }
      return false;
    })) << "a genuine sample does not arrive";
  }

  void open() {
    sender_ = open_bus(config_of(GetParam().first, domain_.number(), Mode::realtime));
    receiver_ = open_bus(config_of(GetParam().second, domain_.number(), Mode::realtime));
  }

  const test::TestDomain domain_;
  std::mt19937 random_{31};
  std::unique_ptr<Bus> sender_, receiver_;
};

TEST_P(WireHostile, rubbish_as_samples_is_rejected_and_genuine_samples_arrive) {
  open();
  NoEvents none;
  const std::unique_ptr<wire::Backend> rubbish(wire::load_plugin(GetParam().first)(
      wire::prepare(config_of(GetParam().first, domain_.number(), Mode::realtime)), none));
  send_rubbish<SceneDescription>(*rubbish);
  send_rubbish<DeviceState>(*rubbish);
  send_rubbish<DeviceCommand>(*rubbish);
  send_rubbish<WorldFrame>(*rubbish);
  send_rubbish<HapticReport>(*rubbish);
  send_rubbish<Control>(*rubbish);
  send_rubbish<Status>(*rubbish);
}

TEST_P(WireHostile, a_foreign_writer_evicts_no_sample) {
  open();
  const auto foreign = open_bus(config_of(GetParam().first, domain_.number(), Mode::realtime));
  const auto floods = [&]<class M>(M genuine) {
    SCOPED_TRACE(kTopicOf<M>.name);
    auto reader = receiver_->reader<M>();
    auto writer = sender_->writer<M>();
    auto flood = foreign->writer<M>();
    ASSERT_TRUE(
        until(*receiver_, [&] { return reader.matched() == 2 && writer.matched() == 1 && flood.matched() == 1; }));
    M sample;
    // A volatile reader may miss the first ones.
    ASSERT_TRUE(until(*receiver_, [&] { return writer.write(genuine) && reader.take(sample) == Take::sample; }));
    reader.trust_sender();
    ASSERT_TRUE(until(*receiver_, [&] { return writer.write(genuine) && reader.take(sample) == Take::sample; }));
    const auto refused = receiver_->events().refused;
    ASSERT_TRUE(writer.write(genuine));
    for (int i = 0; i < 200; ++i) ASSERT_TRUE(flood.write(M{}));
    // Not taken before the flood has arrived.
    ASSERT_TRUE(until(*receiver_, [&] { return receiver_->events().refused > refused + 20; }));
    EXPECT_EQ(reader.take(sample), Take::sample);
    EXPECT_EQ(test::numbers_of(sample), test::numbers_of(genuine));
    EXPECT_GT(reader.refused(), 20U);
  };
  SampleMaker make(3);
  floods(make.make<DeviceState>());
  floods(make.make<WorldFrame>());
  floods(make.make<Status>());
}

// Before a sender is trusted, too.
TEST_P(WireHostile, an_unknown_writer_evicts_no_description_of_a_world) {
  open();
  const auto foreign = open_bus(config_of(GetParam().first, domain_.number(), Mode::realtime));
  auto reader = receiver_->reader<SceneDescription>();
  auto writer = sender_->writer<SceneDescription>();
  auto flood = foreign->writer<SceneDescription>();
  ASSERT_TRUE(
      until(*receiver_, [&] { return reader.matched() == 2 && writer.matched() == 1 && flood.matched() == 1; }));
  SceneDescription scene;
  scene.name = "genuine";
  ASSERT_TRUE(writer.write(scene));
  ASSERT_TRUE(writer.wait_for_acknowledgments(5.0));
  scene.name = "foreign";
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(flood.write(scene));
  ASSERT_TRUE(flood.wait_for_acknowledgments(5.0));
  std::set<std::string> names;
  while (reader.take(scene) == Take::sample) names.insert(scene.name);
  EXPECT_EQ(names, (std::set<std::string>{"genuine", "foreign"}));
}

TEST_P(WireHostile, keys_that_no_program_has_take_no_room) {
  constexpr std::uint32_t kKeys = 2000;
  open();
  NoEvents none;
  const std::unique_ptr<wire::Backend> foreign(wire::load_plugin(GetParam().first)(
      wire::prepare(config_of(GetParam().first, domain_.number(), Mode::realtime)), none));
  auto reader = receiver_->reader<Status>();
  // Of a depth that the foreign one keeps all of its keys for.
  const auto raw =
      foreign->create_writer({kTopicOf<Status>, qos_of(kTopicOf<Status>, Mode::lockstep, 0.001, 0.004), ""});
  ASSERT_TRUE(until(*receiver_, [&] { return raw->matched() > 0 && reader.matched() == 1; }));
  Codec<Status> codec;
  const auto before = receiver_->events().rejected;
  for (std::uint32_t i = 0; i < kKeys; ++i) {
    const auto encoded = codec.encode(Status{});
    Bytes bytes(encoded.begin(), encoded.end());
    for (std::size_t at = 4; at < 12; ++at) bytes[at] = static_cast<std::uint8_t>(random_() | 0x40U);
    ASSERT_TRUE(raw->write(bytes));
  }
  ASSERT_TRUE(until(*receiver_, [&] { return receiver_->events().rejected >= before + kKeys; }));
  auto writer = sender_->writer<Status>();
  Status sent;
  sent.instance = 3;
  sent.steps = 77;
  EXPECT_TRUE(until(*receiver_, [&] {
    EXPECT_TRUE(writer.write(sent));
    Status received;
    while (reader.take(received) != Take::none) {
      if (received.steps == sent.steps) return true;
    }
    return false;
  })) << "a genuine sample does not arrive";
}

TEST_P(WireHostile, rubbish_on_the_ports_ends_no_participant) {
  constexpr int kFirstPort = 7400, kPortsOfDomain = 250, kFirstOffset = 10, kPorts = 8, kDatagrams = 4000;
  open();
  auto writer = sender_->writer<WorldFrame>();
  auto reader = receiver_->reader<WorldFrame>();
  expect_genuine(writer, reader);
  const int out = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ASSERT_GE(out, 0);
  for (int i = 0; i < kDatagrams; ++i) {
    Bytes bytes = random_bytes(random_() % 400);
    // Most look like the protocol, with a random message behind the header, so that they are not refused at once.
    const std::string header = "RTPS\x02\x01\x01\x0f";
    if (i % 4 != 0 && bytes.size() > 24) {
      std::copy(header.begin(), header.end(), bytes.begin());
      constexpr std::uint8_t kKinds[]{0x06, 0x07, 0x08, 0x09, 0x0c, 0x0e, 0x0d, 0x12, 0x13, 0x15, 0x16};
      bytes[20] = kKinds[random_() % std::size(kKinds)];
      bytes[21] = static_cast<std::uint8_t>(1 | random_());
      if (i % 2 == 0) bytes[22] = static_cast<std::uint8_t>(bytes.size() - 24), bytes[23] = bytes.size() > 279;
    }
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port =
        htons(static_cast<std::uint16_t>(kFirstPort + kPortsOfDomain * domain_.number() + kFirstOffset + i % kPorts));
    sendto(out, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  close(out);
  expect_genuine(writer, reader);
  EXPECT_EQ(reader.matched(), 1);
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireHostile, test::kAllPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
