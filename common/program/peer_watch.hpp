#pragma once

#include "rt/cyclic.hpp"
#include "rt/presence.hpp"
#include "wire/await.hpp"

#include <string>

namespace subworld {

/// Whether the peer of a real-time loop is still there. One that has died may be started again, and one that the
/// network has cut off may come back: it is waited for. One that has said why it ends is not.
class PeerWatch {
 public:
  /// `patience_s`: how long a peer without a sign of life is waited for; `heard`: when its newest sample that could be
  /// used arrived.
  PeerWatch(Peer peer, double patience_s, TimePoint heard = {}) : peer_(peer), patience_s_(patience_s), heard_(heard) {}

  /// A sample of the peer has arrived that can be used.
  void heard(TimePoint now) noexcept {
    heard_ = now;
    displaced_since_ = {};
  }
  /// A sample of the peer has arrived that serves another process in the place of this one. One that has died is served
  /// for a moment.
  void serves_another(TimePoint now) noexcept {
    if (displaced_since_ == TimePoint{}) displaced_since_ = now;
    displaced_ = to_seconds(now - displaced_since_) > kGone_s;
  }

  /// Call once per step of `period_s`; `reader` receives the peer's samples.
  template <class M>
  void observe(const Reader<M>& reader, const StatusBeacon& status, TimePoint now, double period_s) noexcept {
    presence_.observe(heard_ == now, alive(reader, status, peer_), period_s);
    if (!presence_.gone()) {
      gone_ = false;
    } else if (!gone_) {
      const bool waits = presence_.dead_s() < patience_s_;
      gone_ = !waits || !status.last_words(peer_.program, peer_.instance).empty();
    }
  }
  /// It is no longer waited for.
  [[nodiscard]] bool gone() const noexcept { return gone_; }
  /// Time since the newest message, s.
  [[nodiscard]] double quiet_s() const noexcept { return presence_.quiet_s(); }
  /// Error text for this program, if the peer is gone or serves another one; empty otherwise.
  [[nodiscard]] std::string fault(const StatusBeacon& status) const {
    if (displaced_) return displaced_text(peer_.program, peer_.instance);
    return gone_ ? status.gone_text(peer_.program, peer_.instance) : std::string();
  }
  [[nodiscard]] TimePoint last_heard() const noexcept { return heard_; }

 private:
  Peer peer_;
  double patience_s_;
  Presence presence_;
  TimePoint heard_;
  bool gone_ = false;
  TimePoint displaced_since_{};
  bool displaced_ = false;
};

}  // namespace subworld
