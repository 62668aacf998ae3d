#include "physics/bullet/contacts/flush_bodies.hpp"

#include "physics/bullet/contacts/convex_points.hpp"

#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>

#include <algorithm>
#include <limits>

namespace subworld::bullet {

namespace {

constexpr double kAlong = 1.0 - 1e-7;  ///< cosine of directions that are equal

/// Calls `visit(movable, fixed, manifold)` for the contacts of movable bodies with fixed ones that are convex or
/// planes.
template <class Visit>
void for_fixed(btDispatcher& dispatcher, const Visit& visit) {
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
    if (manifold.getNumContacts() == 0) continue;
    const btCollisionObject *movable = manifold.getBody0(), *fixed = manifold.getBody1();
    if (movable->isStaticObject()) std::swap(movable, fixed);
    if (movable->isStaticObject() || !fixed->isStaticObject() || fixed->getCollisionShape()->isConcave()) continue;
    visit(*movable, *fixed, manifold);
  }
}

bool is_plane(const btCollisionObject& body) {
  return body.getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE;
}

/// From the fixed body to the movable one.
Vec3 normal_of(const btPersistentManifold& manifold, const btCollisionObject& movable) {
  const Vec3 normal = from_bullet(manifold.getContactPoint(0).m_normalWorldOnB);
  return manifold.getBody0() == &movable ? normal : Vec3(-normal);
}

/// Whether a body pushes along the normal of one of its faces.
bool pushes_with_face(const btCollisionObject& body, const Vec3& normal) {
  if (is_plane(body)) return true;
  const Placed at = placed(body, body.getWorldTransform().getOrigin());
  const Vec3 local = at.turn.transpose() * normal;
  return std::ranges::any_of(at.shape.faces, [&](const ConvexFace& face) { return face.normal.dot(local) > kAlong; });
}

}  // namespace

void FlushBodies::omit_seams(btDispatcher& dispatcher) {
  touches_.clear();
  std::ranges::fill(fixed_touched_, std::uint8_t{0});
  bool any = false;
  for_fixed(dispatcher, [&](const btCollisionObject& movable, const btCollisionObject&, const btPersistentManifold&) {
    const auto id = static_cast<std::uint32_t>(movable.getUserIndex());
    if (fixed_touched_.size() <= id) fixed_touched_.resize(2 * std::size_t{id} + 1);
    if (fixed_touched_[id] < 2) any = ++fixed_touched_[id] == 2 || any;
  });
  if (!any) return;
  for_fixed(dispatcher, [&](const btCollisionObject& movable, const btCollisionObject& fixed, auto& manifold) {
    const auto id = static_cast<std::uint32_t>(movable.getUserIndex());
    if (fixed_touched_[id] == 2) touches_.push_back({id, &movable, &fixed, &manifold});
  });
  for (const Touch& carrier : touches_) {
    if (carrier.manifold->getNumContacts() == 0) continue;
    if (!pushes_with_face(*carrier.fixed, normal_of(*carrier.manifold, *carrier.movable))) continue;
    for (const Touch& other : touches_) {
      if (other.id == carrier.id && other.fixed != carrier.fixed) omit(carrier, other);
    }
  }
}

void FlushBodies::omit(const Touch& carrier, const Touch& other) const {
  if (other.manifold->getNumContacts() == 0 || is_plane(*other.fixed)) return;
  const Vec3 up = normal_of(*carrier.manifold, *carrier.movable);
  if (normal_of(*other.manifold, *other.movable).dot(up) > kAlong) return;
  const btVector3& origin = carrier.movable->getWorldTransform().getOrigin();
  double plane = -std::numeric_limits<double>::infinity(), lowest = -plane;
  for (int i = 0; i < carrier.manifold->getNumContacts(); ++i) {
    const btManifoldPoint& point = carrier.manifold->getContactPoint(i);
    const bool second = carrier.manifold->getBody1() == carrier.fixed;
    const double height = up.dot(from_bullet((second ? point.m_positionWorldOnB : point.m_positionWorldOnA) - origin));
    plane = std::max(plane, height);
    lowest = std::min(lowest, height + point.getDistance());
  }
  const double fine = kFine * carrier.manifold->getContactBreakingThreshold();
  if (placed(*other.fixed, origin).reach(up) > plane + fine) return;
  if (-placed(*carrier.movable, origin).reach(-up) < lowest - fine) return;
  other.manifold->clearManifold();
}

}  // namespace subworld::bullet
