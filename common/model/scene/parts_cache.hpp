#pragma once

#include "model/shapes/convex_parts.hpp"

#include <string>

namespace subworld {

/// `convex_parts`, which are computed once for each mesh and settings. They are kept as an OBJ file in the folder
/// `.subworld` beside the scene or, where that cannot be written, in the user's folder of caches. Failures to write are
/// no errors. `file`: the cache's; empty if there is none.
[[nodiscard]] ConvexParts cached_parts(const Mesh& closed, double concavity_m, std::size_t most_parts,
                                       const std::string& scene_file, std::string& file);

}  // namespace subworld
