#include "live/outbox.hpp"
#include "live/protocol.hpp"
#include "live/world_view.hpp"

#include "model/error.hpp"
#include "wire/codec/schema.hpp"
#include "wire/topics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace subworld::live {
namespace {

Sample sample(std::uint64_t key, std::size_t size, std::uint64_t time_ns = 0) {
  return {key, time_ns, std::make_shared<const std::vector<std::uint8_t>>(size)};
}

TEST(Outbox, KeepsTheNewestSampleOfEachKey) {
  Outbox box;
  for (std::uint64_t i = 0; i < 1000; ++i) box.add_data(1, sample(i % 2, 100, i));
  box.add_data(2, sample(0, 100, 7));
  EXPECT_EQ(box.bytes(), 300U);
  EXPECT_EQ(box.dropped(), 998U);
  EXPECT_EQ(box.take()->data->sample.time_ns, 998U);
  EXPECT_EQ(box.take()->data->sample.time_ns, 999U);
  EXPECT_EQ(box.take()->data->subscription, 2U);
  EXPECT_FALSE(box.take());
  EXPECT_EQ(box.bytes(), 0U);
}

TEST(Outbox, DropsTheOldestSamplesWithoutRoom) {
  Outbox box({.control_bytes = 100, .data_bytes = 1000});
  for (std::uint64_t key = 0; key < 50; ++key) {
    box.add_data(1, sample(key, 300, key));
    EXPECT_LE(box.bytes(), 1000U);
  }
  EXPECT_EQ(box.dropped(), 47U);
  EXPECT_EQ(box.take()->data->sample.time_ns, 47U);
}

TEST(Outbox, SendsASampleThatIsLargerThanItsRoom) {
  Outbox box({.control_bytes = 100, .data_bytes = 1000});
  box.add_data(1, sample(0, 5000));
  box.add_data(1, sample(1, 6000, 1));
  EXPECT_EQ(box.take()->data->sample.time_ns, 1U);
  EXPECT_FALSE(box.take());
}

TEST(Outbox, LosesNoControlMessageAndSaysWhereItHasNoRoom) {
  Outbox box({.control_bytes = 10, .data_bytes = 1000});
  box.add_data(1, sample(0, 100));
  EXPECT_TRUE(box.add_control("12345"));
  EXPECT_TRUE(box.add_control("67890"));
  EXPECT_FALSE(box.add_control("x"));
  EXPECT_EQ(box.take()->text, "12345");
  EXPECT_EQ(box.take()->text, "67890");
  EXPECT_TRUE(box.take()->data);
}

TEST(Outbox, ForgetsASubscriptionThatEnds) {
  Outbox box;
  box.add_data(1, sample(0, 100));
  box.add_data(2, sample(0, 100));
  box.forget(1);
  EXPECT_EQ(box.take()->data->subscription, 2U);
  EXPECT_FALSE(box.take());
}

WorldSnapshot snapshot(double stamp_s, std::vector<std::pair<int, double>> heights) {
  WorldSnapshot snapshot;
  snapshot.stamp_s = stamp_s;
  for (const auto& [id, z] : heights) {
    StampedBody& body = snapshot.moved.emplace_back();
    body.id = BodyId{static_cast<std::uint32_t>(id)};
    body.state.position = {0.0, 0.0, z};
    body.state.orientation = Quat(-0.6, 0.8, 0.0, 0.0);
  }
  return snapshot;
}
/// The rows of a view without users: eight numbers of four bytes each.
std::vector<std::pair<std::uint32_t, std::array<float, 7>>> rows_of(const std::vector<std::uint8_t>& cdr,
                                                                    std::size_t n) {
  std::vector<std::pair<std::uint32_t, std::array<float, 7>>> rows(n);
  std::uint32_t count = 0;
  std::memcpy(&count, cdr.data() + cdr.size() - 32 * n - 4, 4);
  EXPECT_EQ(count, n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint8_t* const row = cdr.data() + cdr.size() - 32 * (n - i);
    std::memcpy(&rows[i].first, row, 4);
    std::memcpy(rows[i].second.data(), row + 4, 28);
  }
  return rows;
}

TEST(WorldView, HasEachBodyThatMovedOnceAndNoneThatTheSceneHasNot) {
  Codec<WorldSnapshot> codec;
  WorldViewer viewer;
  EXPECT_FALSE(viewer.make(0));
  viewer.take(codec.encode(snapshot(1.0, {{0, 1.0}, {2, 3.0}})), 3);
  viewer.take(codec.encode(snapshot(2.0, {{2, 4.0}, {1000000, 1.0}})), 3);
  const auto view = viewer.make(0);
  ASSERT_TRUE(view);
  const auto rows = rows_of(*view, 2);
  EXPECT_EQ(rows[0].first, 0U);
  EXPECT_EQ(rows[1].first, 2U);
  EXPECT_EQ(rows[1].second[2], 4.0F) << "the newest";
  EXPECT_FLOAT_EQ(rows[0].second[3], -0.8F) << "with qw positive";
  EXPECT_FALSE(viewer.make(1'000'000'000)) << "no news";
}

TEST(WorldView, ComesLessOftenWhereItIsLarge) {
  Codec<WorldSnapshot> codec;
  WorldViewer viewer;
  std::vector<std::pair<int, double>> all;
  for (int id = 0; id < 8000; ++id) all.emplace_back(id, 0.0);
  std::size_t bytes = 0;
  for (std::uint64_t tick = 0; tick < 60; ++tick) {  // one second
    viewer.take(codec.encode(snapshot(static_cast<double>(tick), all)), all.size());
    if (const auto view = viewer.make(tick * 1'000'000'000 / 60)) bytes += view->size();
  }
  EXPECT_LT(bytes, 5'000'000U);
  EXPECT_GT(bytes, 2'500'000U) << "ten times a second";
}

TEST(WorldView, IgnoresBytesThatAreNoState) {
  WorldViewer viewer;
  const std::vector<std::uint8_t> nonsense(100, 0xff);
  viewer.take(nonsense, 3);
  EXPECT_FALSE(viewer.make(0));
}

/// Each word that is used as a type is defined before.
TEST(Schema, OfEachTopicIsSelfContained) {
  const std::set<std::string> basic{"boolean", "octet", "double", "string", "unsigned", "long"};
  for (const TopicSpec& topic : kTopics) {
    const std::string name = std::string(topic.type).substr(std::string("subworld::msg::").size());
    const std::string text = schema_of(wire_idl(), name);
    EXPECT_NE(text.find("struct " + name + " {"), std::string::npos);
    EXPECT_EQ(text.find("typedef"), std::string::npos) << name;
    EXPECT_EQ(text.find("//"), std::string::npos) << name;
    std::set<std::string> defined = basic;
    static const std::regex kLine(R"(struct (\w+) \{|\n\s+(?:@key )?(?:sequence<)?(\w+)[^;{]*;)");
    for (std::sregex_iterator at(text.begin(), text.end(), kLine), end; at != end; ++at) {
      if ((*at)[1].matched)
        defined.insert((*at)[1]);
      else
        EXPECT_TRUE(defined.contains((*at)[2])) << name << ": " << at->str();
    }
  }
  EXPECT_EQ(schema_of(wire_idl(), "Control").find("Body"), std::string::npos) << "only what it needs";
  EXPECT_THROW((void)schema_of(wire_idl(), "Contro"), Error);
}

TEST(Protocol, ReadsSubscriptions) {
  const Request request = parse_request(R"({"op":"subscribe","subscriptions":[{"id":7,"channelId":4294967295}]})");
  ASSERT_EQ(request.op, Request::Op::subscribe);
  EXPECT_EQ(request.items.at(0).id, 7U);
  EXPECT_EQ(request.items.at(0).channel, 4294967295U);
  EXPECT_EQ(parse_request(R"({"op":"unsubscribe","subscriptionIds":[7]})").op, Request::Op::unsubscribe);
}

TEST(Protocol, RefusesAnythingElse) {
  for (const char* text : {"", "{", "[]", "{\"op\":1}", "{\"op\":\"x\"}", "{\"op\":\"subscribe\"}",
                           R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]})",
                           R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":4294967296}]})",
                           R"({"op":"unsubscribe","subscriptionIds":["7"]})"}) {
    const Request request = parse_request(text);
    EXPECT_EQ(request.op, Request::Op::refused) << text;
    EXPECT_FALSE(request.why.empty());
  }
}

}  // namespace
}  // namespace subworld::live
