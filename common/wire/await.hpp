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

/// The peer whose samples a loop in lock-step waits for.
struct Peer {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;
};

inline constexpr const char* kEndsWithoutIt = "; a run in lock-step ends without it";

/// Whether a peer is alive although no sample arrives: its writer is alive, and its status too.
template <class From>
bool alive(const From& reader, const StatusBeacon& status, const Peer& peer) noexcept {
  return reader.alive_writers() > 0 && status.hears(peer.program, peer.instance);
}

/// Error text for a message to a peer that could not be sent in lock-step, where writing waits for slow readers.
/// `reader` receives the peer's messages.
template <class From>
std::string unsent_text(const char* topic, const From& reader, const StatusBeacon& status, const Peer& peer) {
  if (!alive(reader, status, peer)) return status.gone_text(peer.program, peer.instance) + kEndsWithoutIt;
  return std::string(topic) + " could not be sent; is " + label_of(peer.program, peer.instance) + " stuck?";
}

/// The place of a message in its run.
inline std::string place_of(const WorldFrame& one) { return "stamp " + std::to_string(one.stamp); }
inline std::string place_of(const DeviceState& one) { return "number " + std::to_string(one.sequence); }
inline std::string place_of(const DeviceCommand& one) { return "number " + std::to_string(one.sequence); }
inline std::string place_of(const HapticReport& one) {
  return "stamp " + std::to_string(one.stamp) + " of user " + std::to_string(index(one.user));
}

/// What a program that stands in lock-step waits for, and what it knows of the sender. `newest`: the sample taken last.
template <class From, class M>
std::string waiting_text(const From& reader, const M& newest, const StatusBeacon& status, const Peer& peer) {
  const auto age_ms = static_cast<int>(1e3 * status.status_age_s(peer.program, peer.instance));
  return "waits for " + label_of(peer.program, peer.instance) + ": " + kTopicOf<M>.name + " after " + place_of(newest) +
         "; writers matched " + std::to_string(reader.matched()) + ", alive " + std::to_string(reader.alive_writers()) +
         "; samples refused " + std::to_string(reader.refused()) + "; its newest status came " +
         std::to_string(age_ms) + " ms ago";
}

/// Waits in lock-step for the next sample that is `ours`; drops others. Marks the loop's stages `wake`, until the
/// sample is received, and `decode`. Returns false when `stopped` returns true. Reports on `status` after a wait of 2
/// s. Calls `on_loss(text)`, and then returns false, when, for 5 s, the peer was not alive; 0.7 s are enough after its
/// own word that it ends, 2 s where another process has begun in its place, or samples come of another run. The time is
/// this process's own, so that a suspended machine is not mistaken for a dead peer; on a busy one the middleware's
/// threads of a living peer may be silent for seconds.
template <class From, class M, class Stages, class Ours, class Stopped, class OnLoss>
bool await(Bus& bus, StatusBeacon& status, From& reader, M& sample, Stages& stages, const Peer& peer, Ours ours,
           Stopped stopped, OnLoss on_loss) {
  using namespace std::chrono_literals;
  using WallClock = std::chrono::steady_clock;
  constexpr auto kPatience = 5000ms, kReplaced = 2000ms, kCertain = 700ms;
  WallClock::duration waited{}, absent{};
  bool foreign = false, said = false;
  const std::uint64_t refused = reader.refused();
  const auto take_next = [&] { return take(reader, sample, stages, Stages::Stage::wake); };
  for (auto last = WallClock::now();;) {
    for (Take taken = take_next(); taken != Take::none; taken = take_next()) {
      if (taken == Take::sample && ours(sample)) {
        if (said) status.note(label_of(peer.program, peer.instance) + " is there again", "");
        return true;
      }
      foreign |= taken == Take::sample;
    }
    foreign |= reader.refused() > refused;
    if (stopped()) return false;
    const bool replaced = status.is_replaced(peer.program, peer.instance);
    if (absent > kPatience || (absent > kReplaced && (replaced || foreign)) ||
        (absent > kCertain && status.has_ended(peer.program, peer.instance))) {
      on_loss(foreign ? replaced_text(peer.program, peer.instance) : status.gone_text(peer.program, peer.instance));
      return false;
    }
    if (waited > 2s && !said) {
      const std::string label = label_of(peer.program, peer.instance);
      status.note(waiting_text(reader, sample, status, peer), label);
      said = true;
    }
    bus.wait(0.05);
    const auto now = WallClock::now();
    const auto step = std::min<WallClock::duration>(now - last, 100ms);
    last = now;
    waited += step;
    absent = !foreign && !replaced && alive(reader, status, peer) ? WallClock::duration{} : absent + step;
  }
}

/// The same for a peer without which the run ends: throws `Error` (failed) that names it.
template <class From, class M, class Stages, class Ours, class Stopped>
bool await(Bus& bus, StatusBeacon& status, From& reader, M& sample, Stages& stages, const Peer& peer, Ours ours,
           Stopped stopped) {
  return await(bus, status, reader, sample, stages, peer, ours, stopped,
               [](const std::string& text) { throw Error(ExitCode::failed, text + kEndsWithoutIt); });
}

}  // namespace subworld
