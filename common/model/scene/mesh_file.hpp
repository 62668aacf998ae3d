#pragma once

#include "model/body.hpp"

#include <string>

namespace subworld {

/// Reads all triangles of a mesh file (STL, OBJ, PLY, Collada, glTF) and joins vertices at equal places. Multiplies
/// coordinates by `scale` to obtain metres. The mesh's z is up: the up axis of Collada and glTF files becomes z, and
/// with `y_up` the y axis of the others. Throws `std::runtime_error` with the fault of the file.
[[nodiscard]] Mesh read_mesh(const std::string& file, double scale, bool y_up);
/// Whether a file of this name tells its up axis: Collada, and glTF, where y is up.
[[nodiscard]] bool tells_up_axis(const std::string& file);

}  // namespace subworld
