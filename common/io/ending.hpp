#pragma once

#include "io/results/results.hpp"
#include "model/error.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// How a program's run ended. The launcher's verdict follows from these.
struct Ending {
  std::uint64_t session = 0;  ///< of the world's run
  double from_s = 0.0;        ///< simulated time at which it began to take part
  double to_s = 0.0;
  std::string by = {};  ///< reason of the end: "duration", "control", "last frame", "last command", or a signal's name
  std::string fault = {};  ///< error text; empty: no error
};

SUBWORLD_HAS_JSON(Ending)

/// How a loop ended; one that throws `Error` (failed) has ended too, with that fault, and what it has measured is
/// written all the same. `so_far()` is what it took part in.
template <class Loop, class SoFar>
Ending ended(const Loop& loop, const SoFar& so_far) {
  try {
    return loop();
  } catch (const Error& wrong) {
    if (wrong.code() != ExitCode::failed) throw;
    Ending ending = so_far();
    if (ending.to_s <= ending.from_s) throw;  // it has measured nothing
    ending.by = "fault";
    ending.fault = wrong.what();
    return ending;
  }
}

/// The name of this machine.
[[nodiscard]] std::string host_name();

/// Writes a program's part of the results, with how it ended and where. An empty path: writes nothing. Then throws
/// `Error` (failed) with the fault, if there is one.
template <class Part>
void conclude(const std::string& path, Part part, const Ending& ending) {
  part.ending = ending;
  part.host = host_name();
  if (!path.empty()) write_part(path, part);
  if (!ending.fault.empty()) throw Error(ExitCode::failed, ending.fault);
}

/// For example "SIGTERM".
[[nodiscard]] std::string name_of_signal(int signal);

}  // namespace subworld
