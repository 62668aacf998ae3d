#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string_view>
#include <type_traits>

namespace subworld {
namespace {

template <class... Values>
constexpr bool kIsRow = std::is_constructible_v<Topic<Status>, Values...>;
static_assert(kIsRow<const char*, const char*, std::uint32_t, Reliability, Durability, int, DeadlineKind>);
static_assert(!kIsRow<const char*, const char*, std::uint32_t, Reliability, Durability, int>, "no deadline");
static_assert(!kIsRow<const char*, const char*, std::uint32_t, Durability, int, DeadlineKind>, "no reliability");
static_assert(!kIsRow<>);

TEST(WireTopics, names_and_types_are_unique) {
  std::set<std::string_view> names, types;
  for (const TopicSpec& topic : kTopics) {
    names.insert(topic.name);
    types.insert(topic.type);
    EXPECT_LE(topic.key_words, 4U) << topic.name;
    EXPECT_GE(topic.depth, 1) << topic.name;
  }
  EXPECT_EQ(names.size(), kTopics.size());
  EXPECT_EQ(types.size(), kTopics.size());
}

TEST(WireTopics, lockstep_never_loses_and_arms_no_deadline) {
  for (const TopicSpec& topic : kTopics) {
    const Qos qos = qos_of(topic, Mode::lockstep, 0.001, 0.004);
    EXPECT_TRUE(qos.reliable) << topic.name;
    EXPECT_TRUE(qos.keep_all) << topic.name;
    EXPECT_TRUE(qos.transient_local) << topic.name;
    EXPECT_EQ(qos.deadline_s, 0.0) << topic.name;
  }
}

TEST(WireTopics, realtime_follows_the_table) {
  const auto qos = [](const TopicSpec& topic) { return qos_of(topic, Mode::realtime, 0.001, 0.004); };
  EXPECT_FALSE(qos(kTopicOf<DeviceState>).reliable);
  EXPECT_EQ(qos(kTopicOf<DeviceState>).depth, 8) << "room for the right sample beside one of a foreign writer";
  EXPECT_DOUBLE_EQ(qos(kTopicOf<DeviceState>).deadline_s, 0.0029);
  EXPECT_DOUBLE_EQ(qos(kTopicOf<DeviceCommand>).deadline_s, 0.0029);
  EXPECT_TRUE(qos(kTopicOf<WorldFrame>).reliable);
  EXPECT_EQ(qos(kTopicOf<WorldFrame>).depth, 8);
  EXPECT_DOUBLE_EQ(qos(kTopicOf<WorldFrame>).deadline_s, 0.0089);
  EXPECT_DOUBLE_EQ(qos(kTopicOf<HapticReport>).deadline_s, 0.0089);
  EXPECT_EQ(qos(kTopicOf<WorldSnapshot>).deadline_s, 0.0);
  EXPECT_TRUE(qos(kTopicOf<SceneDescription>).transient_local);
  EXPECT_TRUE(qos(kTopicOf<Control>).transient_local);
  EXPECT_TRUE(qos(kTopicOf<Status>).transient_local);
  EXPECT_FALSE(qos(kTopicOf<WorldFrame>).transient_local);
  for (const TopicSpec& topic : kTopics) {
    const bool is_written_each_period = topic.deadline != DeadlineKind::none;
    EXPECT_EQ(qos(topic).lease_s, is_written_each_period ? 0.1 : 3.0) << topic.name;
    EXPECT_EQ(qos(topic).writes_live, is_written_each_period) << "no messages of the participant's own: " << topic.name;
    EXPECT_EQ(qos(topic).max_blocking_s, 0.0) << topic.name;
    EXPECT_FALSE(qos(topic).keep_all) << topic.name;
  }
}

TEST(WireTopics, programs_of_many_users_repeat_in_proportion) {
  EXPECT_EQ(thinning(0), 1.0);
  EXPECT_EQ(thinning(8), 1.0);
  EXPECT_EQ(thinning(64), 8.0);
}

// Vendors do not resume after an outage where the leases of a writer and its reader differ.
TEST(WireTopics, a_lease_depends_on_topic_and_mode_alone) {
  for (const TopicSpec& topic : kTopics) {
    for (const Mode mode : {Mode::lockstep, Mode::realtime}) {
      const double lease_s = qos_of(topic, mode, 0.001, 0.004).lease_s;
      EXPECT_GT(lease_s, 0.0) << topic.name;
      for (const double period_s : {0.0001, 0.01, 1.0}) {
        for (const double cycle_s : {0.0005, 0.02, 5.0})
          EXPECT_EQ(qos_of(topic, mode, period_s, cycle_s).lease_s, lease_s) << topic.name;
      }
    }
    // Programs of both modes read these.
    if (topic.durability == Durability::transient_local) {
      EXPECT_EQ(qos_of(topic, Mode::lockstep, 0.001, 0.004).lease_s,
                qos_of(topic, Mode::realtime, 0.001, 0.004).lease_s);
    }
  }
}

TEST(WireTopics, a_deadline_is_at_least_the_interval_in_whole_milliseconds) {
  EXPECT_DOUBLE_EQ(deadline_s(0.0005), 0.0019);
  EXPECT_DOUBLE_EQ(deadline_s(0.001), 0.0019);
  EXPECT_DOUBLE_EQ(deadline_s(2 * 0.0007), 0.0029);
  EXPECT_DOUBLE_EQ(deadline_s(0.01), 0.0109);
  EXPECT_DOUBLE_EQ(deadline_s(2 * 0.005), deadline_s(0.01)) << "whatever its rounding";
}

TEST(WireTopics, vendors_are_parsed_and_others_are_a_usage_error) {
  EXPECT_EQ(parse_vendor("fastdds"), Vendor::fastdds);
  EXPECT_EQ(parse_vendor("cyclonedds"), Vendor::cyclonedds);
  EXPECT_STREQ(name_of(Vendor::cyclonedds), "cyclonedds");
  try {
    (void)parse_vendor("opendds");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    EXPECT_NE(std::string(error.what()).find("cyclonedds"), std::string::npos);
  }
}

}  // namespace
}  // namespace subworld
