#pragma once

#include "model/body.hpp"

#include <Eigen/Core>

namespace subworld {

/// Volume (m^3) of a sphere, box, capsule or cylinder; 0 for a plane. For `convex` and `mesh` see `Solid`.
[[nodiscard]] double volume(const Shape& shape) noexcept;

/// Principal moments (kg m^2) of a solid sphere, box, capsule or cylinder of uniform density about its centre.
[[nodiscard]] Vec3 principal_inertia(const Shape& shape, double mass_kg) noexcept;

/// Mass properties of the volume inside a closed surface, for a density of 1 kg/m^3.
struct Solid {
  double volume = 0.0;                                ///< m^3; negative if the triangles face inwards
  Vec3 centre = Vec3::Zero();                         ///< m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about the centre, mesh axes, kg m^2
};

/// Integrates over the tetrahedra of each triangle and the first vertex (exact for polyhedra).
[[nodiscard]] Solid integrate(const Mesh& mesh) noexcept;

/// Axes (columns, right-handed) and moments of a tensor. Axes that are already principal stay as they are.
struct PrincipalAxes {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Vec3 moments = Vec3::Zero();
};
[[nodiscard]] PrincipalAxes principal_axes(const Eigen::Matrix3d& inertia);
/// Whether a body can have these principal moments: all are positive, and none is above the sum of the others, but for
/// values of a thin plate in three digits.
[[nodiscard]] bool of_a_body(const Vec3& moments) noexcept;

/// True if every edge joins exactly two triangles that pass it in opposite directions.
[[nodiscard]] bool closed(const Mesh& mesh);

/// Convex hull of the mesh's vertices, triangles outwards, without unused vertices. Empty (no triangles) if the
/// vertices are coplanar. Time is quadratic in the number of vertices.
[[nodiscard]] Mesh convex_hull(const Mesh& mesh);

/// Moves and turns the vertices so that the mesh frame is principal and at the centre of mass. Returns the pose of the
/// new frame in the old one.
struct PrincipalFrame {
  Pose frame;
  double volume = 0.0;
  Vec3 inertia = Vec3::Zero();  ///< principal, for a density of 1 kg/m^3
};
[[nodiscard]] PrincipalFrame move_to_principal_frame(Mesh& mesh);

}  // namespace subworld
