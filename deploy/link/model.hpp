#pragma once

#include "link/settings.hpp"

#include <array>
#include <cstdint>
#include <random>

namespace subworld {

/// Why a link drops a packet.
enum class LinkDrop : std::uint8_t { none, loss, outage, queue };

/// What becomes of a packet: dropped, or delivered once or twice.
struct PacketFate {
  LinkDrop drop = LinkDrop::none;
  int copies = 0;                              ///< 0, 1 or 2
  std::array<std::int64_t, 2> departure_ns{};  ///< of each copy, on the clock of the arrival
};

/// One direction of a link, without sockets and clocks: the same seed and arrivals give the same fates. It follows
/// `tc netem` (Hemminger 2005; Salsano, Ludovici, Ordine 2009):
///   * order: each packet has a delay of its own, so jitter lets packets overtake each other. With a rate, packets
///     leave in the order of their arrival: departure = max(arrival + delay, last departure) + size / rate;
///   * reordering: a packet that `reorder` chooses leaves at once;
///   * queue: `limit` counts the packets that have not left yet, delayed ones too;
///   * duplication: a duplicated packet that is lost is delivered once.
/// Each arrival draws the same number of random numbers, so a change of one setting leaves the others' draws alone.
class LinkModel {
 public:
  LinkModel(const LinkSettings& settings, std::uint64_t seed);

  /// A packet of `bytes` arrives at `now_ns`, ns since the link started; arrivals do not go back in time.
  PacketFate arrive(std::int64_t now_ns, int bytes) noexcept;
  /// One copy has left the queue.
  void leave() noexcept { --waiting_; }
  /// Changes the settings; packets on their way keep their departures.
  void set(const LinkSettings& settings) noexcept { settings_ = settings; }

 private:
  [[nodiscard]] double draw() noexcept { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  [[nodiscard]] bool is_lost(double turn, double loss) noexcept;
  [[nodiscard]] std::int64_t departure(std::int64_t now_ns, int bytes, double t) noexcept;

  LinkSettings settings_;
  std::mt19937_64 random_;
  bool bad_ = false;  ///< state of the loss model
  int since_reordered_ = 0;
  int waiting_ = 0;
  std::int64_t last_ns_ = 0;  ///< departure of the packet that arrived last, for the rate
};

}  // namespace subworld
