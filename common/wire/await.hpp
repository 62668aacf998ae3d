#pragma once

#include "model/error.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"
#include "wire/take.hpp"

#include <algorithm>
#include <chrono>
#include <string>

namespace subworld {

/// Whose samples a loop in lock-step waits for.
struct Peer {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;
};

inline constexpr const char* kEndsWithoutIt = "; a run in lock-step ends without it";

/// Whether a peer may be there though nothing comes from it: its writer is alive, and itself too.
template <class M>
bool alive(const Reader<M>& reader, const StatusBeacon& status, const Peer& peer) noexcept {
  return reader.alive_writers() > 0 && status.hears(peer.program, peer.instance);
}

/// Why a message to a peer could not be sent in lock-step, where that waits for readers that lag behind. `reader` is of
/// what comes from it.
template <class M>
std::string unsent_text(const char* topic, const Reader<M>& reader, const StatusBeacon& status, const Peer& peer) {
  if (!alive(reader, status, peer)) return gone_text(peer.program, peer.instance) + kEndsWithoutIt;
  return std::string(topic) + " could not be sent; is " + label_of(peer.program, peer.instance) + " stuck?";
}

/// Waits in lock-step for the next sample that is `ours`; others are dropped. Marks the loop's stages `wake`, until it
/// was received, and `decode`. False when `stopped` says so. Says on
/// `status` when it has waited for 2 s. Throws `Error` (failed) that names the peer when for 0.7 s of this
/// process's own time, so that neither a busy machine nor one that was halted is taken for a dead peer, either the peer
/// was not alive, or what came was of another run or of a program that was started again.
template <class M, class Stages, class Ours, class Stopped>
bool await(Bus& bus, StatusBeacon& status, Reader<M>& reader, M& sample, Stages& stages, const Peer& peer, Ours ours,
           Stopped stopped) {
  using namespace std::chrono_literals;
  using WallClock = std::chrono::steady_clock;
  constexpr auto kPatience = 700ms;
  WallClock::duration waited{}, silent{};
  bool foreign = false, said = false;
  const std::uint64_t refused = reader.refused();
  const auto take_next = [&] { return take(reader, sample, stages, Stages::Stage::wake); };
  for (auto last = WallClock::now();;) {
    for (Take taken = take_next(); taken != Take::none; taken = take_next()) {
      if (taken == Take::sample && ours(sample)) {
        if (said) status.note(label_of(peer.program, peer.instance) + " is there again");
        return true;
      }
      foreign |= taken == Take::sample;
    }
    foreign |= reader.refused() > refused;
    if (stopped()) return false;
    if (silent > kPatience) {
      throw Error(ExitCode::failed, foreign ? replaced_text(peer.program, peer.instance)
                                            : gone_text(peer.program, peer.instance) + kEndsWithoutIt);
    }
    if (waited > 2s && !said) {
      status.note("waits for " + label_of(peer.program, peer.instance));
      said = true;
    }
    bus.wait(0.05);
    const auto now = WallClock::now();
    const auto step = std::min<WallClock::duration>(now - last, 100ms);
    last = now;
    waited += step;
    silent = !foreign && alive(reader, status, peer) ? WallClock::duration{} : silent + step;
  }
}

}  // namespace subworld
