#pragma once

#include "io/results/json.hpp"

#include <functional>
#include <optional>
#include <string>

namespace subworld {

/// Result of a child process.
struct Apart {
  std::optional<Json> answer;
  std::string end;  ///< if there is no answer: how the process ended, for example "SIGSEGV"
};

/// Calls `work` in a child process, so that a crash does not affect this one. Ends a child that takes longer than
/// `most_s`. Throws `Interrupted` if a signal requests a stop. For processes without threads.
[[nodiscard]] Apart apart(double most_s, const std::function<Json()>& work);

}  // namespace subworld
