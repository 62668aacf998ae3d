#pragma once

#include "io/results/results.hpp"

#include <string>

namespace subworld {

/// What the programs of a run without an orderly end have measured: `world`, `haptic` and `device` of the summary, with
/// `state_hash` and `simulated_s` where the world has written them. The part of a program that could write none is made
/// of its history, and has `partial`: true. Reads the parts and histories in the folder.
[[nodiscard]] Json salvage(const std::string& folder, int users);

}  // namespace subworld
