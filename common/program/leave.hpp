#pragma once

#include "rt/cyclic.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace subworld {

inline constexpr double kArrives_s = 5.0;      ///< that a message may take on a busy machine
inline constexpr double kArrivesSoon_s = 0.5;  ///< longest wait for one in real time, and after a stop signal

/// Waits until a peer has acknowledged what `writer` has sent. Gives up where the peer has ended or is silent, and
/// `longest_s` after `begin`.
template <class M>
void await_arrival(Writer<M>& writer, const StatusBeacon& status, const Peer& peer, TimePoint begin,
                   double longest_s = kArrives_s) {
  constexpr double kLook_s = 0.05;
  const auto waits = [&] {
    return to_seconds(Clock::now() - begin) < (stop_signal() == 0 ? longest_s : kArrivesSoon_s) &&
           status.hears(peer.program, peer.instance) && !status.has_ended(peer.program, peer.instance);
  };
  while (!writer.wait_for_acknowledgments(kLook_s) && waits()) {
  }
}

/// Lets a process end without taking its middleware apart, after a run that the world has ended. Where many
/// participants leave a domain together, Fast DDS 2.9 may stop for ever in those that see the others leave: its thread
/// of received messages and its thread of timers wait for each other (eProsima/Fast-DDS#6502). Whoever does not say
/// that it leaves cannot cause it, and after the run nobody needs to know.
///
/// Declare it after the ports and before all that writes results.
class Leave {
 public:
  Leave() = default;
  Leave(const Leave&) = delete;
  Leave& operator=(const Leave&) = delete;
  ~Leave() {
    if (!at_once_) return;
    std::this_thread::sleep_for(kAcknowledge);
    std::fflush(nullptr);
    std::_Exit(EXIT_SUCCESS);
  }
  void at_once() noexcept { at_once_ = true; }

 private:
  /// The middleware acknowledges the last message a few milliseconds after it came.
  static constexpr std::chrono::milliseconds kAcknowledge{50};
  bool at_once_ = false;
};

}  // namespace subworld
