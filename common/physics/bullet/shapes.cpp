#include "shapes.hpp"

#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace subworld::bullet {

namespace {

/// GJK works on the shape less its margin, so a thin one keeps edges sharp; below it contacts would need the slower
/// EPA.
constexpr double kMarginRatio = 0.04;

btScalar margin_of(double smallest_half_size) { return scalar(kMarginRatio * smallest_half_size); }

}  // namespace

const Mesh& ShapeStore::mesh(const Shape& shape) const {
  if (shape.mesh >= meshes_.size()) {
    throw Error(ExitCode::usage,
                fmt::format("shape names mesh {} of {}; load the mesh with the scene", shape.mesh, meshes_.size()));
  }
  return meshes_[shape.mesh];
}

std::unique_ptr<btCollisionShape> ShapeStore::make(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return std::make_unique<btSphereShape>(scalar(shape.radius));
    case ShapeKind::box: {
      auto box = std::make_unique<btBoxShape>(to_bullet(shape.half_extents));
      box->setMargin(margin_of(shape.half_extents.minCoeff()));
      return box;
    }
    case ShapeKind::capsule:
      return std::make_unique<btCapsuleShapeZ>(scalar(shape.radius), scalar(2.0 * shape.half_length));
    case ShapeKind::cylinder: {
      auto cylinder =
          std::make_unique<btCylinderShapeZ>(to_bullet(Vec3(shape.radius, shape.radius, shape.half_length)));
      cylinder->setMargin(margin_of(std::min(shape.radius, shape.half_length)));
      return cylinder;
    }
    case ShapeKind::plane:
      return std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), 0.0);
    case ShapeKind::convex: {
      auto hull = std::make_unique<btConvexHullShape>();
      Box bounds{Vec3::Constant(1e30), Vec3::Constant(-1e30)};
      for (const Vec3& v : mesh(shape).vertices) bounds.extend({v, v});
      const btScalar margin = margin_of(0.5 * (bounds.upper - bounds.lower).minCoeff());
      // Bullet adds the margin outside a hull: draw the vertices in by as much.
      const Vec3 half = (0.5 * (bounds.upper - bounds.lower)).cwiseMax(2.0 * double{margin});
      const Vec3 scale = (half.array() - double{margin}) / half.array();
      const Vec3 centre = 0.5 * (bounds.upper + bounds.lower);
      for (const Vec3& v : mesh(shape).vertices) {
        hull->addPoint(to_bullet(centre + scale.cwiseProduct(v - centre)), false);
      }
      hull->recalcLocalAabb();
      hull->optimizeConvexHull();
      hull->setMargin(margin);
      return hull;
    }
    case ShapeKind::mesh: {
      auto triangles = std::make_unique<btTriangleMesh>();
      const Mesh& source = mesh(shape);
      for (const auto& t : source.triangles) {
        triangles->addTriangle(to_bullet(source.vertices[t[0]]), to_bullet(source.vertices[t[1]]),
                               to_bullet(source.vertices[t[2]]));
      }
      auto tree = std::make_unique<btBvhTriangleMeshShape>(triangles.get(), true);
      tree->setMargin(0.0);
      triangles_.push_back(std::move(triangles));
      return tree;
    }
  }
  throw Error(ExitCode::usage, "Bullet does not know this kind of shape");
}

btCollisionShape* ShapeStore::get(const Shape& shape) {
  const Key key{static_cast<double>(shape.kind), shape.half_extents.x(), shape.half_extents.y(),
                shape.half_extents.z(),          shape.radius,           shape.half_length,
                static_cast<double>(shape.mesh)};
  auto& found = shapes_[key];
  if (!found) found = make(shape);
  return found.get();
}

}  // namespace subworld::bullet
