#pragma once

#include "io/results.hpp"

#include <string>
#include <vector>

namespace subworld {

/// What keeps a run from being a whole one, in words, from the endings that its programs have written into the summary:
/// every program took part in the same world's run and ended by itself, with the world's last frame or the last
/// command, and every user was served from the first to the last stamp. Empty: nothing.
[[nodiscard]] std::vector<std::string> faults_of(const Json& summary);

/// What ended a single program early, from its part of the results; empty: it ended by itself, or has written none.
[[nodiscard]] std::string early_end(const std::string& part_file, double duration_s);

}  // namespace subworld
