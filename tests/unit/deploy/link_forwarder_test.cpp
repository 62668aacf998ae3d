#include "link/forwarder.hpp"
#include "support/allocations.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <thread>
#include <vector>

namespace subworld {
namespace {

constexpr std::uint32_t kSubnet = 0x0a090000;  // 10.9.0.0
constexpr int kPacketBytes = 100;

/// Hosts on pairs of sockets that take the place of TUN devices.
class Hosts {
 public:
  explicit Hosts(int count) {
    for (int i = 0; i < count; ++i) {
      std::array<int, 2> ends{};
      EXPECT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends.data()), 0);
      mine_.push_back(ends[0]);
      theirs_.push_back(ends[1]);
    }
  }
  ~Hosts() {
    for (const int one : mine_) close(one);
    for (const int one : theirs_) close(one);
  }
  Hosts(const Hosts&) = delete;
  Hosts& operator=(const Hosts&) = delete;

  [[nodiscard]] std::vector<Forwarder::Host> ends() const {
    std::vector<Forwarder::Host> all;
    for (std::size_t i = 0; i < theirs_.size(); ++i)
      all.push_back({theirs_[i], kSubnet + 1 + static_cast<std::uint32_t>(i)});
    return all;
  }
  /// Sends an IPv4 packet to an address, with a mark in its contents.
  void send(int from, std::uint32_t to, std::uint8_t mark = 0, std::uint8_t version = 4) const {
    std::array<std::uint8_t, kPacketBytes> packet{};
    packet[0] = static_cast<std::uint8_t>(version << 4 | 5);
    for (int i = 0; i < 4; ++i) packet[16 + i] = static_cast<std::uint8_t>(to >> (24 - 8 * i));
    packet[50] = mark;
    ASSERT_EQ(write(mine_[from], packet.data(), packet.size()), kPacketBytes);
  }
  /// The mark of the next packet that a host receives; -1 where none comes within `limit_ms`.
  [[nodiscard]] int receive(int host, int limit_ms = 2000) const {
    pollfd polled{mine_[host], POLLIN, 0};
    std::array<std::uint8_t, 2048> packet{};
    if (poll(&polled, 1, limit_ms) != 1 || read(mine_[host], packet.data(), packet.size()) != kPacketBytes) return -1;
    return packet[50];
  }

 private:
  std::vector<int> mine_, theirs_;
};

std::vector<LinkSettings> links(int hosts, const std::string& text) {
  return std::vector<LinkSettings>(static_cast<std::size_t>(hosts) * hosts, parse_link(text));
}

TEST(Forwarder, DeliversToTheHostOfTheAddress) {
  const Hosts hosts(3);
  Forwarder forwarder(hosts.ends(), links(3, ""), 1500, 1);
  hosts.send(0, kSubnet + 3, 7);
  EXPECT_EQ(hosts.receive(2), 7);
  EXPECT_EQ(hosts.receive(1, 0), -1);
  hosts.send(2, kSubnet + 1, 8);
  EXPECT_EQ(hosts.receive(0), 8);
  EXPECT_EQ(forwarder.counters({0, 2}).delivered, 1U);
  EXPECT_EQ(forwarder.counters({0, 2}).bytes, 100U);
  EXPECT_EQ(forwarder.counters({0, 1}).packets, 0U);
}

TEST(Forwarder, MulticastAndBroadcastReachAllOthers) {
  const Hosts hosts(3);
  Forwarder forwarder(hosts.ends(), links(3, ""), 1500, 1);
  std::uint8_t mark = 1;
  for (const std::uint32_t to : {0xefff0001U, 0xffffffffU, kSubnet + 255}) {
    hosts.send(1, to, mark);
    EXPECT_EQ(hosts.receive(0), mark);
    EXPECT_EQ(hosts.receive(2), mark);
    EXPECT_EQ(hosts.receive(1, 0), -1);
    ++mark;
  }
}

TEST(Forwarder, WhatIsNotForAHostIsIgnored) {
  const Hosts hosts(2);
  Forwarder forwarder(hosts.ends(), links(2, ""), 1500, 1);
  hosts.send(0, kSubnet + 9);
  hosts.send(0, 0x08080808);
  hosts.send(0, kSubnet + 2, 1, 6);  // IPv6
  hosts.send(0, kSubnet + 2, 2);
  EXPECT_EQ(hosts.receive(1), 2);
  EXPECT_EQ(forwarder.counters({0, 1}).packets, 1U);
}

TEST(Forwarder, EachDirectionHasItsLink) {
  const Hosts hosts(2);
  std::vector<LinkSettings> each = links(2, "");
  each[1] = parse_link("loss 100%");  // from 0 to 1
  Forwarder forwarder(hosts.ends(), each, 1500, 1);
  hosts.send(0, kSubnet + 2);
  hosts.send(1, kSubnet + 1, 5);
  EXPECT_EQ(hosts.receive(0), 5);
  EXPECT_EQ(hosts.receive(1, 50), -1);
  EXPECT_EQ(forwarder.counters({0, 1}).lost, 1U);
}

TEST(Forwarder, ALinkChangesWhileItRuns) {
  const Hosts hosts(2);
  Forwarder forwarder(hosts.ends(), links(2, ""), 1500, 1);
  forwarder.set({0, 1}, parse_link("loss 100%"));
  hosts.send(0, kSubnet + 2, 1);
  EXPECT_EQ(hosts.receive(1, 50), -1);
  forwarder.set({0, 1}, parse_link("ideal"));
  hosts.send(0, kSubnet + 2, 2);
  EXPECT_EQ(hosts.receive(1), 2);
}

TEST(Forwarder, NoPacketLeavesBeforeItsDelay) {
  const Hosts hosts(2);
  Forwarder forwarder(hosts.ends(), links(2, "delay 30ms"), 1500, 1);
  for (std::uint8_t i = 0; i < 10; ++i) hosts.send(0, kSubnet + 2, i);
  for (std::uint8_t i = 0; i < 10; ++i) EXPECT_EQ(hosts.receive(1), i) << "in order";
  EXPECT_GE(forwarder.counters({0, 1}).delay.quantile_s(0.0), 0.0295);
}

TEST(Forwarder, AFullQueueIsCounted) {
  const Hosts hosts(2);
  Forwarder forwarder(hosts.ends(), links(2, "delay 300ms limit 5"), 1500, 1);
  for (std::uint8_t i = 0; i < 20; ++i) hosts.send(0, kSubnet + 2, i);
  for (std::uint8_t i = 0; i < 5; ++i) EXPECT_EQ(hosts.receive(1), i);
  EXPECT_EQ(forwarder.counters({0, 1}).queue_full, 15U);
  hosts.send(0, kSubnet + 2, 99);
  EXPECT_EQ(hosts.receive(1), 99) << "there is room again";
}

TEST(Forwarder, AllocatesNothingForAPacket) {
  const Hosts hosts(3);
  Forwarder forwarder(hosts.ends(), links(3, "delay 1ms 1ms loss 5% duplicate 5%"), 1500, 1);
  static_cast<void>(forwarder.counters({0, 1}));  // it runs
  const long before = test::allocations();
  for (int i = 0; i < 500; ++i) {
    hosts.send(0, i % 10 == 0 ? 0xefff0001U : kSubnet + 2);
    while (hosts.receive(1, 2) >= 0) {
    }
    while (hosts.receive(2, 0) >= 0) {
    }
  }
  EXPECT_EQ(test::allocations() - before, 0);
  EXPECT_EQ(forwarder.counters({0, 1}).packets, 500U);
}

}  // namespace
}  // namespace subworld
