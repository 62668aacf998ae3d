#pragma once

#include <string>
#include <vector>

namespace subworld {

struct RunResults;

/// Why a run is not valid, by the endings that its programs report. In a valid run every program
/// takes part in the run of the same world and ends by itself, with the world's last frame or the last command, and
/// every user is served from the first to the last stamp. Empty: it is valid.
[[nodiscard]] std::vector<std::string> faults_of(const RunResults& run);

/// Why a single program ended early, by its part of the results; empty: it ended by itself, or has written none.
[[nodiscard]] std::string early_end(const std::string& part_file, double duration_s);

}  // namespace subworld
