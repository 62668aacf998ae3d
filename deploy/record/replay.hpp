#pragma once

#include "io/options/live_options.hpp"
#include "model/settings/network.hpp"

#include <string>

namespace subworld {

/// Simulated time per time.
inline constexpr double kLeastReplaySpeed = 1e-3, kMostReplaySpeed = 1e3;

/// The options of `subworld replay`.
struct ReplayRequest {
  std::string file;
  std::string out;          ///< folder for the results of a re-simulation; empty: a new out/replay-TIME
  std::string repair;       ///< file for a complete copy of a recording without an end
  bool resimulate = false;  ///< run the recorded scene again and compare the state hashes
  bool publish = false;     ///< publish the recorded messages
  bool page = false;        ///< the same, with a display that serves the page
  LiveOptions live;
  Network network;
  int domain = -1;  ///< -1: the first that no run holds
  double speed = 1.0;
  double from_s = 0.0;  ///< simulated time
  bool paused = false;
};

/// Prints what a recording holds; on request repairs it, publishes it, or runs it again. Returns the exit code: failed
/// where the hashes differ. Throws `Error` (usage) for a file that is no recording, or one of a run that does not
/// repeat.
int replay(const ReplayRequest& request);

}  // namespace subworld
