#pragma once

#include "lab/network/peer.hpp"

#include <functional>
#include <memory>

namespace subworld {

/// Name of the baseline, in place of a vendor: plain UDP sockets.
inline constexpr const char* kPlainUdp = "udp";
inline constexpr int kMostDatagram_bytes = 65'000;

/// The messages of a process of the cell as plain datagrams: as a back end, so that they are measured with the same
/// code as the vendors.
class UdpBackend : public wire::Backend {
 public:
  /// Waits until a datagram is there, at most a few milliseconds.
  virtual void wait() noexcept = 0;
};

/// Number 0 is the world. Endpoints are made with the partition `user_N`. Throws `Error` (failed).
[[nodiscard]] std::unique_ptr<UdpBackend> open_udp(const PeerPlan& plan, int number, wire::EventSink& events);

}  // namespace subworld
