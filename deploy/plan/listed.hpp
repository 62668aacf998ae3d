#pragma once

#include "model/scene.hpp"

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

}  // namespace subworld
