#include "physics/bullet/shapes.hpp"

#include "model/error.hpp"
#include "model/shapes/shape_extent.hpp"
#include "physics/adapter.hpp"

namespace subworld::bullet {

std::unique_ptr<btCollisionShape> ShapeStore::make(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return std::make_unique<btSphereShape>(scalar(shape.radius));
    case ShapeKind::box: {
      auto box = std::make_unique<btBoxShape>(to_bullet(shape.half_extents));
      box->setMargin(0);
      return box;
    }
    case ShapeKind::capsule:
      return std::make_unique<btCapsuleShapeZ>(scalar(shape.radius), scalar(2.0 * shape.half_length));
    case ShapeKind::cylinder: {
      auto cylinder =
          std::make_unique<btCylinderShapeZ>(to_bullet(Vec3(shape.radius, shape.radius, shape.half_length)));
      cylinder->setMargin(0);
      return cylinder;
    }
    case ShapeKind::plane:
      return std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), 0.0);
    case ShapeKind::convex: {
      auto hull = std::make_unique<btConvexHullShape>();
      const Convex& exact = surfaces_.emplace_back(std::make_unique<ConvexStorage>(mesh_of(shape, meshes_)))->get();
      for (const Vec3& v : exact.vertices) hull->addPoint(to_bullet(v), false);
      hull->setMargin(0);
      hull->recalcLocalAabb();
      hull->setUserPointer(const_cast<Convex*>(&exact));
      return hull;
    }
    case ShapeKind::mesh: {
      auto triangles = std::make_unique<btTriangleMesh>();
      const Mesh& source = mesh_of(shape, meshes_);
      for (const auto& t : source.triangles) {
        triangles->addTriangle(to_bullet(source.vertices[t[0]]), to_bullet(source.vertices[t[1]]),
                               to_bullet(source.vertices[t[2]]));
      }
      auto tree = std::make_unique<btBvhTriangleMeshShape>(triangles.get(), true);
      tree->setMargin(0.0);
      triangles_.push_back(std::move(triangles));
      return tree;
    }
    case ShapeKind::compound: {
      auto compound = std::make_unique<btCompoundShape>(false);
      for (const BodyPart& part : mesh_of(shape, meshes_).parts) {
        compound->addChildShape(btTransform(to_bullet(part.pose.orientation), to_bullet(part.pose.position)),
                                get(part.shape));
      }
      compound->setMargin(0);
      const double around_m = bounding_radius(shape, meshes_), inside_m = 0.5 * thickness(shape, meshes_);
      const auto& ball = surfaces_.emplace_back(std::make_unique<ConvexStorage>(around_m, inside_m))->get();
      compound->setUserPointer(const_cast<Convex*>(&ball));
      return compound;
    }
  }
  throw Error(ExitCode::usage, "Bullet does not know this kind of shape");
}

btCollisionShape* ShapeStore::get(const Shape& shape) {
  const Key key{static_cast<double>(shape.kind), shape.half_extents.x(), shape.half_extents.y(),
                shape.half_extents.z(),          shape.radius,           shape.half_length,
                static_cast<double>(shape.mesh)};
  auto& found = shapes_[key];
  if (found) return found.get();
  found = make(shape);
  const bool simple = shape.kind != ShapeKind::plane && shape.kind < ShapeKind::convex;
  if (simple) {
    found->setUserPointer(const_cast<Convex*>(&surfaces_.emplace_back(std::make_unique<ConvexStorage>(shape))->get()));
  }
  return found.get();
}

void set_velocity_of(btRigidBody& body, const Vec3& linear, const Vec3& angular) {
  body.setLinearVelocity(to_bullet(linear));
  body.setAngularVelocity(to_bullet(angular));
  body.setInterpolationLinearVelocity(body.getLinearVelocity());
  body.setInterpolationAngularVelocity(body.getAngularVelocity());
}

void set_pose(btRigidBody& body, const BodyState& state) {
  const btTransform pose(to_bullet(state.orientation), to_bullet(state.position));
  body.setWorldTransform(pose);
  body.setInterpolationWorldTransform(pose);
  set_velocity_of(body, state.linear_velocity, state.angular_velocity);
  body.updateInertiaTensor();
}

}  // namespace subworld::bullet
