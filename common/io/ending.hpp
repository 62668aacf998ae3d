#pragma once

#include "io/results.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// How a program's part in a run went, for its results: the launcher's verdict follows from these.
struct Ending {
  std::uint64_t session = 0;  ///< of the world's run
  double from_s = 0.0;        ///< simulated time that it served
  double to_s = 0.0;
  std::string by = {};     ///< what ended it: "duration", "control", "last frame", "last command", or a signal's name
  std::string fault = {};  ///< what went wrong, in words; empty: nothing
};

[[nodiscard]] Json to_json(const Ending& ending);

/// Writes a program's part of the results with how it ended; an empty path: nowhere. Then throws `Error` (failed) with
/// the fault, if there is one.
void conclude(const std::string& path, Json part, const Ending& ending);

/// "SIGTERM".
[[nodiscard]] std::string name_of_signal(int signal);

}  // namespace subworld
