#pragma once

#include "model/scene/scene.hpp"

#include <string>
#include <vector>

namespace subworld {

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
/// Joints that fix two bodies to each other, or a body to the world, once more. Those that break are not meant.
void warn_of_double_joints(const Scene& scene, std::vector<std::string>& out);
/// That there is such an engine and preset, for the scene's pairs and joints. Throws `Error` that names the place.
void check_engine(const Scene& scene, const EngineSettings& settings, const std::string& where);
/// What the engine says of the first body of each kind that it does not hold.
[[nodiscard]] std::vector<std::string> refused_bodies(const Scene& scene, const EngineSettings& settings);
/// Bodies that overlap, and bodies at rest that nothing supports.
void warn_of_the_start(const Scene& scene, std::vector<std::string>& out);

}  // namespace subworld
