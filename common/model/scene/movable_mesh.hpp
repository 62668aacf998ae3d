#pragma once

#include "model/body.hpp"

#include <optional>
#include <string>
#include <utility>

namespace subworld {

/// Turns the triangles of a mesh that can move as convex parts outwards. Else returns its fault, and the cure.
[[nodiscard]] std::optional<std::pair<std::string, std::string>> turn_outwards(Mesh& mesh);

/// Of a `decompose` without one: 1 % of the mesh's diagonal, m.
[[nodiscard]] double usual_concavity_m(const Mesh& mesh);

}  // namespace subworld
