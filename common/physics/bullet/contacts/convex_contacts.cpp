#include "physics/bullet/contacts/convex_contacts.hpp"

#include "physics/bullet/contacts/contact_algorithm.hpp"
#include "physics/bullet/contacts/convex_points.hpp"

namespace subworld::bullet {

namespace {

/// An algorithm of a convex body, with one manifold.
class ConvexAlgorithm : public OneManifold {
 public:
  ConvexAlgorithm(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject& a,
                  const btCollisionObject& b, bool swapped)
      : OneManifold(info, a, b, swapped),
        reach_(manifold_->getContactBreakingThreshold()),
        same_(same_within(a, b)),
        pair_(a, b) {}

 protected:
  /// Reach in this step of `dt` for bodies that are not fast.
  [[nodiscard]] double reach_now(const btCollisionObject& a, const btCollisionObject& b, double way, double dt) const {
    return looks_ahead() && way == 0.0 ? std::max(reach_, pair_.motion(a, b, dt)) : reach_;
  }

  double reach_;  ///< there are no points beyond this distance, m
  btScalar same_;
  FastPair pair_;
  PatchMemory memory_;
};

class ConvexConvex final : public ConvexAlgorithm {
 public:
  using ConvexAlgorithm::ConvexAlgorithm;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* /*result*/) override {
    const auto [a, b] = ordered(first, second);
    const btVector3& origin = b.getWorldTransform().getOrigin();
    const Placed at_a = placed(a, origin), at_b = placed(b, origin);
    const double way = pair_.way(a, b, info.m_timeStep);
    Patch patch = touch(at_a, at_b, reach_now(a, b, way, info.m_timeStep), kFine * reach_, memory_);
    if (way > reach_) {
      if (patch.count == 0) return look_ahead(*manifold_, a, b, way, info.m_timeStep);
      patch = touch(at_a, at_b, way, kFine * reach_, memory_);
    }
    if (passes_by(patch, at_a, Sweep(a), at_b, Sweep(b), info.m_timeStep, kFine * reach_)) patch.count = 0;
    if (patch.count > 0 || manifold_->getNumContacts() > 0) write(*manifold_, in_world(patch, origin), a, b, same_);
  }
};

class ConvexPlane final : public ConvexAlgorithm {
 public:
  using ConvexAlgorithm::ConvexAlgorithm;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* /*result*/) override {
    const auto [a, b] = ordered(first, second);
    const auto& plane = *static_cast<const btStaticPlaneShape*>(b.getCollisionShape());
    const btTransform& pose = b.getWorldTransform();
    const btVector3 normal = pose.getBasis() * plane.getPlaneNormal();
    const btVector3& origin = a.getWorldTransform().getOrigin();
    const double offset = plane.getPlaneConstant() - normal.dot(origin - pose.getOrigin());
    const double way = pair_.way(a, b, info.m_timeStep);
    const double reach = std::max(reach_now(a, b, way, info.m_timeStep), way);
    const Patch patch = touch_plane(placed(a, origin), from_bullet(normal), offset, reach, kFine * reach_, memory_);
    if (patch.count == 0 && manifold_->getNumContacts() == 0) return;
    Points points = in_world(patch, origin);
    points.normal = normal;
    write(*manifold_, points, a, b, same_);
  }
};

}  // namespace

btDefaultCollisionConstructionInfo collision_settings() {
  btDefaultCollisionConstructionInfo info;
  info.m_customCollisionAlgorithmMaxElementSize = kMostAlgorithmBytes;
  return info;
}

void look_ahead(btPersistentManifold& manifold, const btCollisionObject& a, const btCollisionObject& b, double way,
                double dt) {
  const btVector3& origin = b.getWorldTransform().getOrigin();
  const Placed a_now = placed(a, origin), b_now = placed(b, origin);
  const Sweep sweep_a(a), sweep_b(b);
  const double reach = manifold.getContactBreakingThreshold(), fine = kFine * reach;
  Points points;
  if (const auto when = first_touch(a_now, sweep_a, b_now, sweep_b, dt, fine)) {
    const Placed a_then = sweep_a.after(a_now, *when), b_then = sweep_b.after(b_now, *when);
    PatchMemory memory;
    const Patch patch = touch(a_then, b_then, std::max(reach, way), fine, memory);
    points.normal = to_bullet(patch.normal);
    for (const PatchPoint& p : patch.all()) {
      points.points[points.count++] =
          seen_from_now(back_from(p, patch.normal, a_then, a_now, b_then, b_now), patch.normal, p.feature, origin);
    }
  }
  if (points.count > 0 || manifold.getNumContacts() > 0) write(manifold, points, a, b, same_within(a, b));
}

void register_convex_contacts(btCollisionDispatcher& dispatcher) {
  static Make<ConvexConvex> convex(false);
  static Make<ConvexPlane> plane(false), swapped_plane(true);
  for (const int one : kConvexShapes) {
    for (const int other : kConvexShapes) {
      if (one == BOX_SHAPE_PROXYTYPE && other == BOX_SHAPE_PROXYTYPE) continue;
      dispatcher.registerCollisionCreateFunc(one, other, &convex);
    }
    dispatcher.registerCollisionCreateFunc(one, STATIC_PLANE_PROXYTYPE, &plane);
    dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, one, &swapped_plane);
  }
  register_mesh_contacts(dispatcher);
  register_compound_contacts(dispatcher, plane);
}

}  // namespace subworld::bullet
