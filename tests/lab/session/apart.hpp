#pragma once

#include "io/results.hpp"

#include <functional>
#include <optional>
#include <string>

namespace subworld {

/// What a child process came to.
struct Apart {
  std::optional<Json> answer;
  std::string end;  ///< where there is no answer: how the process ended, as in "SIGSEGV"
};

/// Calls `work` in a child process, so that nothing that happens in it harms this one. A child that takes longer than
/// `most_s` is ended. Throws `Interrupted` where a signal asks to stop. For processes without threads.
[[nodiscard]] Apart apart(double most_s, const std::function<Json()>& work);

}  // namespace subworld
