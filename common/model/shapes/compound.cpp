#include "model/shapes/compound.hpp"

#include "model/shapes/mass_properties.hpp"

#include <cmath>

namespace subworld {

namespace {

constexpr std::uint32_t kSides = 24;  ///< of a round surface
constexpr std::uint32_t kRings = 6;   ///< of a half ball

/// Distances from the axis and heights of a surface of revolution, downwards; the ends are on the axis.
using Outline = std::vector<Eigen::Vector2d>;

Outline outline_of(const Shape& shape) {
  if (shape.kind == ShapeKind::cylinder) {
    const double r = shape.radius, h = shape.half_length;
    return {{0.0, h}, {r, h}, {r, -h}, {0.0, -h}};
  }
  Outline outline;
  for (const double end : {1.0, -1.0}) {
    for (std::uint32_t i = 0; i <= kRings; ++i) {
      const double angle = 0.5 * M_PI * (end > 0.0 ? i : kRings + i) / kRings;
      outline.emplace_back(shape.radius * std::sin(angle), end * shape.half_length + shape.radius * std::cos(angle));
    }
  }
  return outline;
}

Mesh turned_around(const Outline& outline) {
  Mesh mesh;
  for (const Eigen::Vector2d& at : outline) {
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const double angle = 2.0 * M_PI * side / kSides;
      mesh.vertices.emplace_back(at.x() * std::cos(angle), at.x() * std::sin(angle), at.y());
    }
  }
  const auto rings = static_cast<std::uint32_t>(outline.size());
  for (std::uint32_t ring = 0; ring + 1 < rings; ++ring) {
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const std::uint32_t next = (side + 1) % kSides, a = ring * kSides + side, b = ring * kSides + next;
      if (ring + 2 < rings) mesh.triangles.push_back({a, a + kSides, b + kSides});
      if (ring > 0) mesh.triangles.push_back({a, b + kSides, b});
    }
  }
  return mesh;
}

Mesh faces_of_box(const Vec3& half) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.push_back(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).cwiseProduct(half));
  mesh.triangles = {{1, 3, 7}, {1, 7, 5}, {0, 4, 6}, {0, 6, 2}, {2, 6, 7}, {2, 7, 3},
                    {0, 1, 5}, {0, 5, 4}, {4, 5, 7}, {4, 7, 6}, {0, 2, 3}, {0, 3, 1}};
  return mesh;
}

}  // namespace

Mesh surface(const Shape& shape, std::span<const Mesh> meshes) {
  if (shape.kind == ShapeKind::convex) return meshes[shape.mesh];
  return shape.kind == ShapeKind::box ? faces_of_box(shape.half_extents) : turned_around(outline_of(shape));
}

MassProperties total_of(std::span<const WeightedPart> parts) {
  MassProperties whole;
  for (const WeightedPart& one : parts) {
    whole.mass += one.mass;
    whole.centre += one.mass * one.part.pose.position;
  }
  if (whole.mass > 0.0) whole.centre /= whole.mass;
  for (const WeightedPart& one : parts) {
    const Eigen::Matrix3d turn = one.part.pose.orientation.toRotationMatrix();
    const Vec3 arm = one.part.pose.position - whole.centre;
    whole.inertia += turn * one.inertia.asDiagonal() * turn.transpose();
    whole.inertia += one.mass * (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
  }
  return whole;
}

Compound assemble(std::span<const WeightedPart> parts, std::span<const Mesh> meshes, const MassProperties& given) {
  Compound whole;
  const PrincipalAxes principal = principal_axes(given.inertia);
  whole.mass = given.mass;
  whole.frame = {given.centre, Quat(principal.axes).normalized()};
  whole.inertia = principal.moments;
  const Quat back = whole.frame.orientation.conjugate();
  const Pose from_parts{back * -whole.frame.position, back};
  for (const WeightedPart& one : parts) {
    BodyPart& part = whole.mesh.parts.emplace_back(one.part);
    part.pose = from_parts * one.part.pose;
    part.pose.orientation.normalize();
    const Mesh around = surface(part.shape, meshes);
    const auto first = static_cast<std::uint32_t>(whole.mesh.vertices.size());
    for (const Vec3& v : around.vertices) whole.mesh.vertices.push_back(part.pose.position + part.pose.orientation * v);
    for (const auto& [a, b, c] : around.triangles) whole.mesh.triangles.push_back({first + a, first + b, first + c});
  }
  return whole;
}

}  // namespace subworld
