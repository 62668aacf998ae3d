#pragma once

#include "physics/bullet/contacts/contact_points.hpp"
#include "physics/bullet/contacts/patch.hpp"
#include "physics/bullet/shapes.hpp"
#include "physics/bullet/sweep.hpp"

#include <algorithm>

namespace subworld::bullet {

/// The shapes with a `Convex`, by Bullet's numbers.
inline constexpr int kConvexShapes[] = {SPHERE_SHAPE_PROXYTYPE, CAPSULE_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE,
                                        CONVEX_HULL_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE};

/// Length below which differences do not affect the choice of contacts, relative to the breaking threshold.
inline constexpr double kFine = 0.1;
/// A point that replaces another one inherits its impulses within this distance, relative to the smaller body.
inline constexpr double kSame = 0.1;

/// The shape with its pose, in a frame at `origin` with the axes of the world: numbers near it are small.
inline Placed placed(const btCollisionObject& object, const btVector3& origin) {
  const btTransform& pose = object.getWorldTransform();
  Placed at{convex_of(*object.getCollisionShape()), {}, from_bullet(pose.getOrigin() - origin)};
  for (int i = 0; i < 3; ++i) at.turn.row(i) = from_bullet(pose.getBasis()[i]);
  return at;
}

/// The points of a patch in the world, in Bullet's format.
inline Points in_world(const Patch& patch, const btVector3& origin) {
  Points points;
  points.normal = to_bullet(patch.normal);
  for (const PatchPoint& p : patch.all()) {
    points.points[points.count++] = {to_bullet(p.on_b) + origin, scalar(p.distance), p.feature};
  }
  return points;
}

inline Point seen_from_now(const Ahead& ahead, const Vec3& normal, int feature, const btVector3& origin) {
  const Vec3 aside = ahead.on_a - ahead.on_b - ahead.distance * normal;
  return {to_bullet(ahead.on_b) + origin, scalar(ahead.distance), feature, to_bullet(aside)};
}

inline btScalar same_within(const btCollisionObject& a, const btCollisionObject& b) {
  const auto size = [](const btCollisionObject& object) {
    const btCollisionShape& shape = *object.getCollisionShape();
    return shape.getUserPointer() != nullptr ? convex_of(shape).outer_radius : 1e30;
  };
  return scalar(kSame * std::min(size(a), size(b)));
}

inline void write(btPersistentManifold& manifold, const Points& points, const btCollisionObject& a,
                  const btCollisionObject& b, btScalar same) {
  const btScalar reach = manifold.getContactBreakingThreshold();
  ManifoldWriter writer(manifold, reach, same);
  std::array<LastPoint, kMostPoints> before;
  const auto old = writer.take(before);
  if (points.count == 0) return;
  writer.put(points, a, b, BT_LARGE_FLOAT);
  writer.go_on_from(old);
}

}  // namespace subworld::bullet
