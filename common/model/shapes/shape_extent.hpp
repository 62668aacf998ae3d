#pragma once

#include "model/body.hpp"

#include <span>

namespace subworld {

/// The axis-aligned box around a shape in this pose, m. Unbounded for a plane.
[[nodiscard]] Box bounds(const Shape& shape, const BodyState& state, std::span<const Mesh> meshes);

/// Radius of the ball around the body's origin that contains the shape, m; infinite for a plane, 0 if the mesh is
/// missing.
[[nodiscard]] double bounding_radius(const Shape& shape, std::span<const Mesh> meshes) noexcept;

/// The shape's least extent along the axes of the body frame, m: infinite for a plane, zero for a triangle mesh, that
/// of its thinnest part for a compound body.
[[nodiscard]] double thickness(const Shape& shape, std::span<const Mesh> meshes);

}  // namespace subworld
