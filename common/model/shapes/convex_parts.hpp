#pragma once

#include "model/body.hpp"

#include <vector>

namespace subworld {

/// A closed surface, triangles outwards, in convex parts that may overlap.
struct ConvexParts {
  std::vector<Mesh> hulls;
  /// Largest distance of a sampled point of the parts, inside or on the surface, from the solid that the surface
  /// encloses; or of a sampled point of the surface from the parts, if that is larger.
  double error_m = 0.0;
};

/// Cuts the solid by planes until no point of a part's hull is farther than `concavity_m` from it, or `most_parts` are
/// reached. The same bits on every machine that runs the same binary.
[[nodiscard]] ConvexParts convex_parts(const Mesh& closed, double concavity_m, std::size_t most_parts);

}  // namespace subworld
