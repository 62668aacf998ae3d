#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace subworld {

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
