#pragma once

#include "io/results.hpp"

#include <string>

namespace subworld {

/// A run in plain words, from its summary: what happened, what to look at, what to try next. `folder` has the results,
/// `command` starts this program.
[[nodiscard]] std::string explanation(const Json& summary, const std::string& folder, bool pictured,
                                      const std::string& command);

}  // namespace subworld
