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
/// The first body of each kind of shape that an engine refuses. `where`: "world" or "haptic".
void warn_of_refused_bodies(const Scene& scene, const EngineSettings& settings, const char* where,
                            std::vector<std::string>& out);
/// Bodies that overlap, and bodies at rest that nothing supports.
void warn_of_the_start(const Scene& scene, std::vector<std::string>& out);

}  // namespace subworld
