#pragma once

#include "model/body.hpp"

#include <string>

namespace subworld {

/// Reads all triangles of a mesh file (STL, OBJ, PLY, Collada, glTF) and joins vertices at equal places. Coordinates
/// are multiplied by `scale` to be metres. Throws `std::runtime_error` saying what is wrong with the file.
[[nodiscard]] Mesh read_mesh(const std::string& file, double scale);

}  // namespace subworld
