#pragma once

#include "model/scene.hpp"

#include <string>
#include <vector>

namespace subworld {

struct RunRequest;

/// Prints warnings of what is beyond limits. Throws `Error` (usage) for a request that the programs would refuse,
/// before any is started; it names the place and the cure.
void check_request(const Scene& scene, const RunRequest& request);

/// Prints which optimisations are on or off for a scene, with the reasons, or its settings. Throws `Error` (usage)
/// where `run` would.
void print_plan(const RunRequest& request, bool settings);

/// How many users of a run on this domain one host has room for, and why.
[[nodiscard]] std::string user_limit(int domain);

/// What of a scene is beyond the limits of its engines, rates or devices, each with the cure in a sentence or two.
/// Throws `Error` (usage) where the settings name no engine or preset.
[[nodiscard]] std::vector<std::string> beyond_limits(const Scene& scene);

/// "a, b and 3 more"
[[nodiscard]] std::string listed(const std::vector<std::string>& items);

/// Names of the bodies of which `holds` is true.
template <class Holds>
std::vector<std::string> names_of(const Scene& scene, const Holds& holds) {
  std::vector<std::string> names;
  for (const Body& body : scene.bodies) {
    if (holds(body)) names.push_back(body.name);
  }
  return names;
}

/// Bodies with a density that no material has, and that one has if the body was described in mm, cm or g.
void warn_of_slips(const Scene& scene, std::vector<std::string>& out);
/// Bodies that overlap, and bodies at rest that nothing supports.
void warn_of_the_start(const Scene& scene, std::vector<std::string>& out);

}  // namespace subworld
