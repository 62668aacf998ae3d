#pragma once

#include "link/model.hpp"
#include "rt/histogram.hpp"

#include <atomic>
#include <cstdint>
#include <functional>
#include <semaphore>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// What one direction of a link has done since it started.
struct LinkCounters {
  std::uint64_t packets = 0;  ///< that a host sent
  std::uint64_t bytes = 0;
  std::uint64_t delivered = 0;  ///< with duplicates
  std::uint64_t lost = 0;       ///< by `loss`
  std::uint64_t in_outage = 0;
  std::uint64_t queue_full = 0;
  std::uint64_t duplicated = 0;
  std::uint64_t refused = 0;  ///< that the receiver's kernel did not take
  Histogram delay = {};       ///< from when the forwarder read a packet until the receiver's kernel had it
  Histogram lateness = {};    ///< of that against the requested departure
};

/// A sending host and a receiving host, numbered from 0.
struct LinkEnds {
  int from = 0;
  int to = 0;
};

/// Forwards IPv4 packets between TUN devices in its own thread. A packet to the address of another host passes the
/// `LinkModel` of that pair; a broadcast or multicast packet passes one to each other host. The loop sleeps until the
/// next departure, an absolute time, or until a packet arrives. It allocates nothing after the start: packets lie in a
/// pool, and a packet that finds no room is dropped and counted as `queue_full`. One other thread at a
/// time may call it.
class Forwarder {
 public:
  struct Host {
    int tun = -1;               ///< non-blocking; not owned
    std::uint32_t address = 0;  ///< IPv4, in host order
  };
  /// `links[from * hosts + to]`; those of a host to itself are not used.
  Forwarder(std::vector<Host> hosts, const std::vector<LinkSettings>& links, int mtu, std::uint64_t seed);
  ~Forwarder();
  Forwarder(const Forwarder&) = delete;
  Forwarder& operator=(const Forwarder&) = delete;

  /// Takes effect before the next packet.
  void set(LinkEnds ends, const LinkSettings& settings);
  [[nodiscard]] LinkCounters counters(LinkEnds ends);
  /// CPU time of the thread so far, s.
  [[nodiscard]] double cpu_s();
  /// The scheduling that the OS granted, in words.
  [[nodiscard]] std::string scheduling() const { return scheduling_; }

 private:
  struct Waiting {
    std::int64_t departure_ns;
    std::uint64_t number;  ///< of the arrival: equal departures leave in order
    std::int64_t arrival_ns;
    std::uint32_t slot;
    std::uint32_t link;
  };
  void run();
  void send_due();
  bool receive(std::size_t host);
  void route(std::size_t host, std::uint32_t slot, int bytes, std::int64_t now_ns);
  void pass(std::size_t link, std::uint32_t slot, int bytes, std::int64_t now_ns);
  void wait();
  void release(std::uint32_t slot) noexcept;
  [[nodiscard]] std::int64_t now_ns() const noexcept;
  [[nodiscard]] std::size_t index(LinkEnds ends) const noexcept { return ends.from * hosts_.size() + ends.to; }
  /// Calls `act` in the thread, between two packets, and returns when that is done.
  void in_thread(const std::function<void()>& act);

  std::vector<Host> hosts_;
  std::vector<LinkModel> links_;
  std::vector<LinkCounters> counters_;
  int mtu_;
  std::vector<std::uint8_t> pool_;
  std::vector<int> sizes_;           ///< of the packet in each slot, bytes
  std::vector<int> uses_;            ///< copies of each slot that wait
  std::vector<std::uint32_t> free_;  ///< slots
  std::vector<Waiting> waiting_;     ///< a heap, the next departure first
  std::uint64_t arrivals_ = 0;
  std::int64_t start_ns_ = 0;
  int wake_ = -1;  ///< eventfd
  std::atomic<const std::function<void()>*> act_{nullptr};
  std::binary_semaphore acted_{0};
  bool stop_ = false;
  std::string scheduling_;
  std::thread thread_;
};

}  // namespace subworld
