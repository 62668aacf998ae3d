#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

namespace subworld {
namespace {

using test::config_of;
using test::TestDomain;
using test::until;

class WireEvents : public ::testing::TestWithParam<test::VendorPair> {};

TEST_P(WireEvents, a_writer_that_stops_sending_misses_its_deadline) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto writer = sender->writer<WorldFrame>();
  auto reader = receiver->reader<WorldFrame>();
  ASSERT_TRUE(until(*receiver, [&] { return writer.matched() > 0 && reader.matched() > 0; }));
  EXPECT_EQ(receiver->events().deadline_missed, 0U) << "armed before the first sample";
  WorldFrame frame;
  // A volatile reader may miss the first ones.
  ASSERT_TRUE(until(*receiver, [&] { return writer.write(frame) && reader.take(frame) == Take::sample; }));
  ASSERT_TRUE(until(*receiver, [&] { return receiver->events().deadline_missed > 0; }));
  ASSERT_TRUE(until(*sender, [&] { return sender->events().deadline_missed > 0; }));
  EXPECT_TRUE(receiver->take_event_text(EventKind::fault).empty());
  const std::string text = receiver->take_event_text(EventKind::absence);
  EXPECT_NE(text.find("no world_frame for two periods: world_sim or the network was late"), std::string::npos) << text;
  EXPECT_TRUE(sender->take_event_text(EventKind::absence).empty()) << "a writer's own loop counts its deadlines";
  const auto missed = receiver->events().deadline_missed;
  ASSERT_TRUE(until(*receiver, [&] { return receiver->events().deadline_missed > missed; }));
  EXPECT_TRUE(receiver->take_event_text(EventKind::absence).empty()) << "once is enough";
}

// A timer that a vendor arms with too short a time would count each of these samples as late.
TEST_P(WireEvents, a_writer_in_time_misses_no_deadline) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::microseconds kGap{1200}, kLongestGap{2000};
  constexpr std::uint64_t kSamples = 800;
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::realtime));
  auto writer = sender->writer<DeviceState>();
  auto reader = receiver->reader<DeviceState>();
  ASSERT_TRUE(until(*receiver, [&] { return writer.matched() > 0 && reader.matched() > 0; }));
  DeviceState state;
  std::uint64_t by_os = 0, received = 0;
  auto before = Clock::now();
  for (auto next = before; state.sequence < kSamples; next = std::max(next + kGap, before)) {
    std::this_thread::sleep_until(next);
    ++state.sequence;
    ASSERT_TRUE(writer.write(state));
    received += reader.take(state) == Take::sample;
    const auto now = Clock::now();
    by_os += static_cast<std::uint64_t>((now - before) / kLongestGap);
    before = now;
  }
  EXPECT_GT(received, kSamples / 2);
  EXPECT_LE(sender->events().deadline_missed, by_os + kSamples / 4);
  EXPECT_LE(receiver->events().deadline_missed, by_os + kSamples / 4);
}

/// The helper is in the test's folder.
pid_t start_helper(Vendor vendor, int domain) {
  const std::string helper = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "wire_peer").string();
  const std::string number = std::to_string(domain);
  const pid_t child = fork();
  if (child == 0) {
    execl(helper.c_str(), helper.c_str(), name_of(vendor), number.c_str(), "realtime", static_cast<char*>(nullptr));
    _exit(127);
  }
  return child;
}

TEST_P(WireEvents, a_killed_writer_is_noticed) {
  const TestDomain held;
  const int domain = held.number();
  const pid_t child = start_helper(GetParam().first, domain);
  ASSERT_GT(child, 0);
  BusConfig config = config_of(GetParam().second, domain, Mode::realtime);
  config.device_period_s = config.cycle_s = 0.01;
  const auto bus = open_bus(config);
  auto reader = bus->reader<DeviceState>();
  DeviceState state;
  const bool heard = until(*bus, [&] { return reader.take(state) == Take::sample && reader.alive_writers() == 1; });
  const auto lost_before = bus->events().liveliness_lost;
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ASSERT_TRUE(heard);
  EXPECT_TRUE(until(
      *bus, [&] { return reader.alive_writers() == 0; }, 2.0));
  EXPECT_GT(bus->events().liveliness_lost, lost_before);
  const std::string text = bus->take_event_text(EventKind::absence);
  EXPECT_NE(text.find("no sign of life of device_sim for 100 ms"), std::string::npos) << text;
}

TEST_P(WireEvents, modes_that_do_not_fit_name_topic_and_policy) {
  const TestDomain held;
  const int domain = held.number();
  const auto sender = open_bus(config_of(GetParam().first, domain, Mode::realtime));
  const auto receiver = open_bus(config_of(GetParam().second, domain, Mode::lockstep));
  auto writer = sender->writer<WorldSnapshot>();
  auto reader = receiver->reader<WorldSnapshot>();
  ASSERT_TRUE(until(*receiver, [&] { return receiver->events().incompatible_qos > 0; }));
  const auto names_the_cure = [](const std::string& text) {
    return text.find("world_state") != std::string::npos && text.find("RELIABILITY") != std::string::npos &&
           text.find("--mode") != std::string::npos;
  };
  std::string text = receiver->take_event_text(EventKind::fault);
  EXPECT_TRUE(names_the_cure(text)) << text;
  ASSERT_TRUE(until(*sender, [&] { return sender->events().incompatible_qos > 0; }));
  text = sender->take_event_text(EventKind::fault);
  EXPECT_TRUE(names_the_cure(text)) << text;
  EXPECT_EQ(writer.matched(), 0);
  EXPECT_EQ(reader.matched(), 0);
}

TEST_P(WireEvents, a_writer_that_leaves_unmatches_and_the_wait_returns_for_it) {
  const TestDomain held;
  const int domain = held.number();
  auto sender = open_bus(config_of(GetParam().first, domain));
  const auto receiver = open_bus(config_of(GetParam().second, domain));
  auto reader = receiver->reader<Control>();
  {
    auto writer = sender->writer<Control>();
    ASSERT_TRUE(until(*receiver, [&] { return reader.matched() == 1 && writer.matched() == 1; }));
  }
  ASSERT_TRUE(until(*receiver, [&] { return reader.matched() == 0; }));
  EXPECT_EQ(receiver->events().matched, 1U);
  EXPECT_EQ(receiver->events().unmatched, 1U);
  EXPECT_EQ(reader.alive_writers(), 0);
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireEvents, test::kMixedPairs, test::name_of_pair);
INSTANTIATE_TEST_SUITE_P(FullRealtime, WireEvents, test::kEqualPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
