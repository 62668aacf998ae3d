#include "model/shapes/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr double kFar_m = std::numeric_limits<double>::infinity();

/// Half of the extent along each world axis, for a shape that is symmetric about the origin.
Vec3 half_extent(const Shape& shape, const Eigen::Matrix3d& rotation) {
  const Eigen::Array3d axis = rotation.col(2).array().abs();
  switch (shape.kind) {
    case ShapeKind::box:
      return rotation.cwiseAbs() * shape.half_extents;
    case ShapeKind::capsule:
      return shape.half_length * axis + shape.radius;
    case ShapeKind::cylinder:
      return shape.half_length * axis + shape.radius * (1.0 - axis.square()).max(0.0).sqrt();
    default:
      return Vec3::Constant(shape.radius);
  }
}

/// Bounds of the vertices in this pose.
Box around(const Mesh& mesh, const BodyState& state) {
  Box box{Vec3::Constant(kFar_m), Vec3::Constant(-kFar_m)};
  for (const Vec3& vertex : mesh.vertices) {
    const Vec3 at = state.position + state.orientation * vertex;
    box.extend({at, at});
  }
  return box;
}

/// Parts of a compound shape; none where a message has brought it.
std::span<const BodyPart> parts_of(const Shape& shape, std::span<const Mesh> meshes) {
  if (shape.kind != ShapeKind::compound || shape.mesh >= meshes.size()) return {};
  return meshes[shape.mesh].parts;
}

}  // namespace

Box bounds(const Shape& shape, const BodyState& state, std::span<const Mesh> meshes) {
  if (const auto parts = parts_of(shape, meshes); !parts.empty()) {
    Box box{Vec3::Constant(kFar_m), Vec3::Constant(-kFar_m)};
    for (const BodyPart& part : parts) {
      const Pose at = Pose{state.position, state.orientation} * part.pose;
      box.extend(bounds(part.shape, {at.position, at.orientation}, meshes));
    }
    return box;
  }
  switch (shape.kind) {
    case ShapeKind::plane:
      return {Vec3::Constant(-kFar_m), Vec3::Constant(kFar_m)};
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:
      return around(meshes[shape.mesh], state);
    default:
      break;
  }
  const Vec3 half = half_extent(shape, state.orientation.toRotationMatrix());
  return {state.position - half, state.position + half};
}

double bounding_radius(const Shape& shape, std::span<const Mesh> meshes) noexcept {
  if (const auto parts = parts_of(shape, meshes); !parts.empty()) {
    double most = 0.0;
    for (const BodyPart& part : parts)
      most = std::max(most, part.pose.position.norm() + bounding_radius(part.shape, meshes));
    return most;
  }
  switch (shape.kind) {
    case ShapeKind::sphere:
      return shape.radius;
    case ShapeKind::box:
      return shape.half_extents.norm();
    case ShapeKind::capsule:
      return shape.radius + shape.half_length;
    case ShapeKind::cylinder:
      return std::hypot(shape.radius, shape.half_length);
    case ShapeKind::plane:
      return kFar_m;
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:
      break;
  }
  if (shape.mesh >= meshes.size()) return 0.0;
  double squared = 0.0;
  for (const Vec3& vertex : meshes[shape.mesh].vertices) {
    if (vertex.allFinite()) squared = std::max(squared, vertex.squaredNorm());
  }
  return std::sqrt(squared);
}

double thickness(const Shape& shape, std::span<const Mesh> meshes) {
  if (shape.kind == ShapeKind::plane) return kFar_m;
  if (shape.kind == ShapeKind::mesh) return 0.0;
  if (const auto parts = parts_of(shape, meshes); !parts.empty()) {
    double least = kFar_m;
    for (const BodyPart& part : parts) least = std::min(least, thickness(part.shape, meshes));
    return least;
  }
  const Box box = bounds(shape, {}, meshes);
  return (box.upper - box.lower).minCoeff();
}

}  // namespace subworld
