#include "physics/bullet/contacts/hidden_points.hpp"

#include "physics/bullet/contacts/convex_points.hpp"
#include "physics/bullet/parts.hpp"

#include <algorithm>
#include <limits>

namespace subworld::bullet {

namespace {

// Lengths relative to the breaking threshold of the part, which is about 2 % of its size.
constexpr double kFromEdge = 1.0;  ///< a point nearer to an edge of its face counts as one at this distance
constexpr double kAbove = 0.1;     ///< distance from the face at which another part must be
/// How deep inside the other part. Less is penetration: a body in a corner is a little inside both walls.
constexpr double kDeep = 0.25;
constexpr double kParallel = 0.02;  ///< 1 - cos^2 of the angle between normals of one and the same face

/// Depth of a point in a shape, m; negative outside. Surfaces that look against `normal` do not count: the shape stands
/// on the face with that normal.
double depth_in(const Placed& shape, const Vec3& point, const Vec3& normal) {
  const Convex& convex = shape.shape;
  const Vec3 at = shape.turn.transpose() * (point - shape.at), up = shape.turn.transpose() * normal;
  double depth = std::numeric_limits<double>::infinity();
  for (const ConvexFace& face : convex.faces) {
    const double below = face.offset - face.normal.dot(at);
    if (below < 0.0 || face.normal.dot(up) > kParallel - 1.0) depth = std::min(depth, below);
  }
  switch (convex.core) {
    case Convex::Core::polyhedron:
      return depth;
    case Convex::Core::cylinder:
      return std::min(depth, convex.disc_radius - at.head<2>().norm());
    case Convex::Core::point:
      return convex.radius - at.norm();
    case Convex::Core::segment:
      return convex.radius -
             Vec3(at.x(), at.y(), at.z() - std::clamp(at.z(), -convex.half_length, convex.half_length)).norm();
  }
  return -1.0;
}

/// Moves a point of a face along the face, away from its edges.
Vec3 away_from_edges(const Placed& part, Vec3 point, const Vec3& normal, double distance) {
  for (std::uint32_t f = 0; f < part.shape.faces.size(); ++f) {
    const Vec3 side = part.face_normal(f);
    const Vec3 along = side.dot(normal) * normal - side;
    const double too_near = side.dot(point) - part.face_offset(f) + distance;
    if (too_near > 0.0 && along.squaredNorm() > kParallel) point += too_near / along.squaredNorm() * along;
  }
  return point;
}

/// Whether another part covers a point of part number `part`, which is `own`.
bool covered(const Vec3& point, const Vec3& normal, const Parts& parts, std::size_t part, const Placed& own,
             const btVector3& origin, double reach) {
  const Vec3 above = away_from_edges(own, point, normal, kFromEdge * reach) + kAbove * reach * normal;
  return std::ranges::any_of(parts.beside(part), [&](std::uint32_t other) {
    return depth_in(placed(*parts.all()[other], origin), above, normal) > kDeep * reach;
  });
}

}  // namespace

void omit_hidden(btPersistentManifold& manifold, const btCollisionObject& compound, std::size_t part) {
  if (manifold.getNumContacts() == 0) return;
  const btVector3& origin = compound.getWorldTransform().getOrigin();
  const double reach = manifold.getContactBreakingThreshold();
  const bool first = manifold.getBody0() == &compound;
  const Parts& parts = parts_of(compound);
  const Placed own = placed(*parts.all()[part], origin);
  for (int i = manifold.getNumContacts() - 1; i >= 0; --i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    const Vec3 normal = from_bullet(point.m_normalWorldOnB) * (first ? -1.0 : 1.0);
    const Vec3 at = from_bullet((first ? point.m_positionWorldOnA : point.m_positionWorldOnB) - origin);
    if (covered(at, normal, parts, part, own, origin, reach)) manifold.removeContactPoint(i);
  }
}

}  // namespace subworld::bullet
