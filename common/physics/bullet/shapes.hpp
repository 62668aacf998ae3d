#pragma once

#include "model/body.hpp"
#include "physics/bullet/convex.hpp"

#include <btBulletDynamicsCommon.h>

#include <map>
#include <memory>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Bullet is compiled for one precision; this folder is compiled for both.
inline btScalar scalar(double x) { return static_cast<btScalar>(x); }
inline btVector3 to_bullet(const Vec3& v) { return {scalar(v.x()), scalar(v.y()), scalar(v.z())}; }
inline btQuaternion to_bullet(const Quat& q) { return {scalar(q.x()), scalar(q.y()), scalar(q.z()), scalar(q.w())}; }
inline Vec3 from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
inline Quat from_bullet(const btQuaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

/// The exact surface of a convex shape from a ShapeStore.
inline const Convex& convex_of(const btCollisionShape& shape) {
  return *static_cast<const Convex*>(shape.getUserPointer());
}

/// Bullet's shapes by value: bodies of equal shape share one.
class ShapeStore {
 public:
  explicit ShapeStore(std::span<const Mesh> meshes) : meshes_(meshes.begin(), meshes.end()) {}

  /// Throws `Error` (usage) if a mesh index is out of range.
  [[nodiscard]] btCollisionShape* get(const Shape& shape);
  /// Of a compound shape.
  [[nodiscard]] std::span<const BodyPart> parts(const Shape& shape) const { return meshes_.at(shape.mesh).parts; }

 private:
  using Key = std::array<double, 7>;
  [[nodiscard]] std::unique_ptr<btCollisionShape> make(const Shape& shape);

  std::vector<Mesh> meshes_;
  std::vector<std::unique_ptr<btTriangleMesh>> triangles_;
  std::vector<std::unique_ptr<ConvexStorage>> surfaces_;
  std::map<Key, std::unique_ptr<btCollisionShape>> shapes_;
};

/// Moves a body, and sets its velocities, m/s and rad/s.
void set_pose(btRigidBody& body, const BodyState& state);
void set_velocity_of(btRigidBody& body, const Vec3& linear, const Vec3& angular);

}  // namespace subworld::bullet
