#pragma once

#include <string>

namespace subworld {

/// The options of `subworld replay`.
struct ReplayRequest {
  std::string file;
  std::string out;          ///< folder for the results of a re-simulation; empty: a new out/replay-TIME
  bool resimulate = false;  ///< run the recorded scene again and compare the state hashes
};

/// Prints what a recording holds; on request runs it again. Returns the exit code: failed where the hashes differ.
/// Throws `Error` (usage) for a file that is no finished recording, or one of a run that does not repeat.
int replay(const ReplayRequest& request);

}  // namespace subworld
