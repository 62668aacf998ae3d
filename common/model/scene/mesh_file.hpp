#pragma once

#include "model/body.hpp"

#include <string>

namespace subworld {

/// Reads all triangles of a mesh file (STL, OBJ, PLY, Collada, glTF) and joins vertices at equal places. Multiplies
/// coordinates by `scale` to obtain metres. Throws `std::runtime_error` with the fault of the file.
[[nodiscard]] Mesh read_mesh(const std::string& file, double scale);

}  // namespace subworld
