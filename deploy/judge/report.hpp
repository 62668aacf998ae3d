#pragma once

#include "judge/summary.hpp"
#include "rt/calibration.hpp"
#include "run/run.hpp"
#include "run/supervise.hpp"
#include "watch/watchdog.hpp"
#include "wire/message_memory.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// How the programs ended.
struct Ended {
  std::optional<Supervisor::Failure> failure;
  Watchdog::Stall stall;
  int signal = 0;                  ///< that stopped the run; 0: none
  bool orphaned = false;           ///< the launcher was killed
  std::string display;             ///< how it died, although that ends no run; empty: it did not
  std::vector<std::string> parts;  ///< files of the results
};

/// Stops what is left of the programs. How they ended, with the failure that the supervisor has found.
[[nodiscard]] Ended end(Supervisor& programs, std::optional<Supervisor::Failure> failure, const Watchdog& watchdog);

/// Exit code of a run that failed with this program.
[[nodiscard]] int exit_code_after(const Supervisor::Child& failed);

/// The end of a run: reads the parts of the results, judges, prints, writes the summary, and removes the parts. Where
/// programs have written none, what their histories hold is in the summary. Returns the exit code. Throws `Error`
/// (failed) where the summary cannot be written.
int conclude_run(RunResults& run, const Ended& ended, const RunRequest& request, const std::string& folder,
                 const std::optional<Calibration>& calibration);

/// Files in which the programs of a run write their results.
[[nodiscard]] std::vector<std::string> parts_of(const std::string& folder, int users);

/// After a failed run: writes the last messages of each program to `logs/last_PROGRAM.csv`.
void write_last_messages(const RunResults& run, const MessageMemory& messages, const std::string& folder);

/// ISO 8601 with the zone.
[[nodiscard]] std::string date_of_now();

}  // namespace subworld
