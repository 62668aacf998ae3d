#pragma once

#include "link/host.hpp"

#include <string>
#include <vector>

namespace subworld {

struct Finished {
  int code = -1;
  std::string text;
};
/// Runs a program, in a host's namespace or (null) in this one. Returns its exit code with all that it printed.
[[nodiscard]] Finished run_program(const std::vector<std::string>& words, const NetworkHost* host);

}  // namespace subworld
