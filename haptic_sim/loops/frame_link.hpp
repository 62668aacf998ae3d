#pragma once

#include "haptic_sim/loops/frame_queue.hpp"
#include "haptic_sim/loops/run.hpp"
#include "program/peer_watch.hpp"
#include "wire/take.hpp"

#include <utility>

namespace subworld {

/// The world of a haptic process in real time: its frames, and whether it is there.
class FrameLink {
 public:
  FrameLink(const HapticRun& run, const FirstFrame& first)
      : run_(run),
        frames_(first.frame.stamp),
        watch_({ProgramKind::world_sim, 0}, run.options.wait_s, first.received),
        joins_(first.frame.served == 0) {}

  /// The next frame that has come until `now`, which waits from now on; null: none.
  const WorldFrame* receive(TimePoint now, Stages<HapticStage>& stages) {
    HapticPorts& ports = run_.ports;
    while (!frames_.full() && take(ports.frames, frames_.slot(), stages) == Take::sample) {
      if (frames_.slot().session != ports.session) continue;
      if (ports.serves_another(frames_.slot())) {
        watch_.serves_another(now);
        continue;
      }
      if (const WorldFrame* const came = frames_.push()) {
        ports.frames.trust_sender();
        watch_.heard(now);
        if (came->served == ports.identity) joins_ = false;
        return came;
      }
      run_.measures.refused_frame();
    }
    return nullptr;
  }
  [[nodiscard]] std::span<const WorldFrame> waiting() const noexcept { return frames_.waiting(); }
  /// Whether a sub-world starts anew from the newest frame that waits, because it has used none of this world, or
  /// because the world has missed it for so long that the user counts as absent.
  [[nodiscard]] bool begins_anew() const noexcept { return !framed_ || (waiting().back().served == 0 && !joins_); }
  /// The oldest have been used. True where the newest of them must be answered: a world that waits for its users is
  /// answered, each time, for the answer may be lost.
  bool used(std::size_t count, bool anew) {
    const bool stands = count > 0 && waiting()[count - 1].real_time_factor <= 0.0;
    joins_ = joins_ || anew;
    framed_ = true;
    frames_.drop(count);
    return joins_ && stands;
  }

  /// Without a frame for `patience_s` the world is away. True where another one has been found in its place, which has
  /// another session; `ends`: none is looked for.
  bool observe(TimePoint now, double patience_s, bool ends) {
    HapticPorts& ports = run_.ports;
    const bool silent = now - watch_.last_heard() > from_seconds(kGone_s);
    if (silent && !silent_)
      ports.status.note("waits for world_sim: no frame for 2 s; the force has faded", "world_sim");
    if (!silent && silent_) ports.status.note("world_sim is there again", "");
    silent_ = silent;
    if (watch_.quiet_s() < patience_s) {
      absent_ = false;
      return false;
    }
    if (!std::exchange(absent_, true)) {
      ports.frames.distrust();
      joins_ = false;
    }
    SessionFinder& finder = run_.finder;
    if (ends || !finder.look(run_.options.network.domain) || finder.session() == ports.session) return false;
    ports.session = finder.session();
    joins_ = framed_ = false;
    frames_.restart();
    return true;
  }
  [[nodiscard]] PeerWatch& watch() noexcept { return watch_; }
  /// The world's run has sent a frame, from which the sub-world has started.
  [[nodiscard]] bool framed() const noexcept { return framed_; }

 private:
  const HapticRun& run_;
  FrameQueue frames_;
  PeerWatch watch_;
  bool joins_;  ///< the sub-world has started anew, and no frame says yet that the world serves it
  bool framed_ = true;
  bool absent_ = false;
  bool silent_ = false;  ///< frames stay away, and the user knows
};

}  // namespace subworld
