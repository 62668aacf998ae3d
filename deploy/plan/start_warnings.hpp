#pragma once

#include "model/scene.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Bodies with a density that no material has, and that one has if the body was described in mm, cm or g.
void warn_of_slips(const Scene& scene, std::vector<std::string>& out);
/// Bodies that overlap, and bodies at rest that nothing supports.
void warn_of_the_start(const Scene& scene, std::vector<std::string>& out);

}  // namespace subworld
