#pragma once

#include "model/body.hpp"

#include <array>
#include <vector>

namespace subworld {

/// One corner of a triangle as the graphics card reads it.
struct MeshVertex {
  std::array<float, 3> position{};
  std::array<float, 3> normal{};
  /// Component i falls from 1 to 0 towards the edge opposite to corner i if that edge is sharp, else it is 1. Edge
  /// lines are drawn where a component is nearly 0.
  std::array<float, 3> edge{};
  float stretch = 0.0F;  ///< -1 .. 1: along z, in units of the instance's half length
};

/// Three vertices a triangle, counter-clockwise seen from outside.
using ShapeMesh = std::vector<MeshVertex>;

/// Half sides of 1.
[[nodiscard]] ShapeMesh box_mesh();
/// Radius 1.
[[nodiscard]] ShapeMesh sphere_mesh(int segments);
/// Radius 1 and half length 1, axis z.
[[nodiscard]] ShapeMesh cylinder_mesh(int segments);
/// Radius 1 from z = 0 to the tip at z = 1.
[[nodiscard]] ShapeMesh cone_mesh(int segments);
/// Two half spheres of radius 1 at z = 0, moved apart and joined by `MeshVertex::stretch`.
[[nodiscard]] ShapeMesh capsule_mesh(int segments);
/// The triangles of a file. Equal vertices are welded. Triangles without area, with invalid indices or with non-finite
/// vertices are omitted.
[[nodiscard]] ShapeMesh file_mesh(const Mesh& mesh);

}  // namespace subworld
