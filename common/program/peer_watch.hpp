#pragma once

#include "rt/cyclic.hpp"
#include "rt/presence.hpp"
#include "wire/await.hpp"

#include <string>

namespace subworld {

/// Whether the peer of a real-time loop is still there, and still the same one.
class PeerWatch {
 public:
  /// `heard`: when its newest sample that could be used arrived.
  explicit PeerWatch(Peer peer, TimePoint heard = {}) : peer_(peer), heard_(heard) {}

  /// A sample has arrived: of the peer, or of another run or process.
  void came(bool foreign) noexcept { foreign_ = foreign; }
  /// A sample of the peer has arrived that can be used.
  void heard(TimePoint now) noexcept { heard_ = now; }
  /// Samples of another writer were refused.
  void refused(TimePoint now) noexcept { foreign_ = foreign_ || heard_ != now; }

  /// Call once per step of `period_s`; `reader` receives the peer's samples.
  template <class M>
  void observe(const Reader<M>& reader, const StatusBeacon& status, TimePoint now, double period_s) noexcept {
    presence_.observe(heard_ == now, !foreign_ && alive(reader, status, peer_), period_s);
  }
  [[nodiscard]] bool gone() const noexcept { return presence_.gone(); }
  /// Error text if the peer is gone or was replaced; empty otherwise.
  [[nodiscard]] std::string fault(const StatusBeacon& status) const;
  [[nodiscard]] TimePoint last_heard() const noexcept { return heard_; }

 private:
  Peer peer_;
  Presence presence_;
  TimePoint heard_;
  bool foreign_ = false;  ///< the newest sample was of another run or process
};

}  // namespace subworld
