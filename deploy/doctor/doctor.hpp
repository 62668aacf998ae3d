#pragma once

#include "doctor/facts.hpp"

namespace subworld::doctor {

/// Examines this machine, its network and a domain, and prints what is wrong. Returns 0 where nothing is, else 4.
/// Throws `Error` (usage) where the scene is wrong.
int run(const Request& request);

}  // namespace subworld::doctor
