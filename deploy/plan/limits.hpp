#pragma once

#include "model/scene/scene.hpp"

#include <string>
#include <vector>

namespace subworld {

struct RunRequest;

/// Prints warnings of what is beyond limits. Throws `Error` (usage) for a request that the programs would refuse,
/// before any is started; it names the place and the cure. `users_of_a_host`: most whose programs run on one host.
void check_request(const Scene& scene, const RunRequest& request, int users_of_a_host);

/// Prints which optimisations are on or off for a scene, with the reasons, or its settings. Throws `Error` (usage)
/// where `run` would.
void print_plan(const RunRequest& request, bool settings);

/// How many users of a run on this domain one host has room for, and why.
[[nodiscard]] std::string user_limit(int domain);

/// What of a scene is beyond the limits of its engines, rates or devices, each with the cure in a sentence or two.
/// Throws `Error` (usage) where the settings name no engine or preset.
[[nodiscard]] std::vector<std::string> beyond_limits(const Scene& scene);

}  // namespace subworld
