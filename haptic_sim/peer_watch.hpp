#pragma once

#include "haptic_sim/ports.hpp"
#include "rt/presence.hpp"
#include "wire/await.hpp"

#include <string>

namespace subworld {

/// Whether the world and the device of a haptic process are still there, in real time.
class PeerWatch {
 public:
  /// `framed`: when the first frame came.
  PeerWatch(std::uint32_t user, TimePoint framed) : device_sim_{ProgramKind::device_sim, user}, framed_(framed) {}

  /// A frame has come: of the run, or of another one.
  void frame_came(bool foreign) noexcept { foreign_ = foreign; }
  /// A frame of the run has come that can be used.
  void framed(TimePoint now) noexcept { framed_ = now; }
  /// Frames of another writer were refused.
  void refused(TimePoint now) noexcept { foreign_ = foreign_ || framed_ != now; }

  /// Once a step of `period_s`. A fault in words where a peer has gone; empty otherwise.
  std::string observe(HapticPorts& ports, bool device_came, TimePoint now, double period_s) {
    world_.observe(framed_ == now, !foreign_ && alive(ports.frames, ports.status, kWorldSim), period_s);
    device_.observe(device_came, alive(ports.device, ports.status, device_sim_), period_s);
    if (world_.gone())
      return foreign_ ? replaced_text(ProgramKind::world_sim, 0) : gone_text(ProgramKind::world_sim, 0);
    return device_.gone() ? gone_text(ProgramKind::device_sim, device_sim_.instance) : std::string();
  }
  /// Says once that frames stay away, and once that they come again.
  void announce(StatusBeacon& status, TimePoint now) {
    const bool silent = now - framed_ > from_seconds(kGone_s);
    if (silent && !announced_) status.note("waits for world_sim: no frame for 2 s; the force has faded", "world_sim");
    if (!silent && announced_) status.note("world_sim is there again", "");
    announced_ = silent;
  }
  [[nodiscard]] double without_frame_s(TimePoint now) const noexcept { return to_seconds(now - framed_); }

 private:
  static constexpr Peer kWorldSim{ProgramKind::world_sim, 0};

  Peer device_sim_;
  Presence world_, device_;
  TimePoint framed_;      ///< when the newest frame came
  bool foreign_ = false;  ///< the newest frame was of another run
  bool announced_ = false;
};

}  // namespace subworld
