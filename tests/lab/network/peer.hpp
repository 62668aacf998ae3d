#pragma once

#include "lab/network/cell.hpp"
#include "lab/network/statistics.hpp"
#include "link/host.hpp"
#include "wire/backend.hpp"

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

/// The processes of a cell. The world sends a numbered, stamped message to each user at the rate, on absolute
/// deadlines. A user returns each message at once. Both use the product's own middleware layer, as bytes.
namespace subworld {

/// Messages of the first 0.5 s do not count.
inline constexpr double kStartUp_s = 0.5;

enum class CellPhase : int {
  matching,
  starting,  ///< the world sends; nothing counts yet
  measuring,
  draining,  ///< all is sent; messages may still arrive
  ending,
};

inline constexpr std::size_t kWireEvents = static_cast<std::size_t>(wire::Event::refused) + 1;

/// What one process reports.
struct PeerShared {
  std::atomic<bool> matched{false};
  std::atomic<bool> reported{false};  ///< the figures below are complete
  std::array<char, 512> failure{};    ///< empty: none
  std::array<std::atomic<std::uint64_t>, kWireEvents> events{};
  double cpu_s = 0.0;       ///< while measuring
  double measured_s = 0.0;  ///< wall time of that
  std::array<char, 256> scheduling{};
};

/// Of the messages to one user, and back.
struct ChannelShared {
  Arrivals there;                         ///< at the user; `delay` is one way
  Arrivals round_trip;                    ///< at the world; `delay` is the round trip
  Histogram back;                         ///< one way
  std::atomic<std::uint64_t> refused{0};  ///< writes that the middleware refused, both ways
};

/// Memory of all processes of a cell.
struct CellShared {
  std::atomic<CellPhase> phase{CellPhase::matching};
  std::atomic<std::uint64_t> sent{0};                   ///< to each user, with those of the start-up
  std::int64_t begin_ns = 0;                            ///< when the first message that counts was sent
  std::int64_t end_ns = 0;                              ///< when the last one was sent
  std::array<PeerShared, kMostNetworkUsers + 1> peers;  ///< the world first
  std::array<ChannelShared, kMostNetworkUsers> channels;
};

/// What a process is to do.
struct PeerPlan {
  NetworkCell cell;
  double duration_s = 1.0;  ///< that counts
  int domain = 0;
  const NetworkHost* host = nullptr;   ///< null: this one
  std::string interface_address = {};  ///< empty: loopback
  std::vector<std::string> peers = {};

  [[nodiscard]] std::uint64_t first() const;  ///< number of the first message that counts
  [[nodiscard]] std::uint64_t most() const;   ///< messages in all
};

/// Process number 0 is the world, number u + 1 is user u. Forks; the calling process must not have loaded a vendor. The
/// child ends with this process, and ignores the terminal's signals. Throws `Error` (failed).
[[nodiscard]] pid_t start_peer(const PeerPlan& plan, int number, CellShared& shared);

}  // namespace subworld
