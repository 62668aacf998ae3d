#pragma once

#include <string>

namespace subworld {

struct RunResults;

/// A run in plain words, from its results: what happened, what to look at, what to try next. `folder` has the results,
/// `command` starts this program.
[[nodiscard]] std::string explanation(const RunResults& run, const std::string& folder, bool pictured,
                                      const std::string& command);

}  // namespace subworld
