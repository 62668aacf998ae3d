#include "physics/bullet/contacts/box_plane.hpp"

#include "physics/bullet/contacts/contact_algorithm.hpp"

#include <algorithm>
#include <array>

namespace subworld::bullet {

namespace {

/// Farther from the plane than this part of its half diagonal, no corner touches it, whatever is rounded.
constexpr auto kFarFromPlane = btScalar(1.001);

class BoxPlane final : public OneManifold {
 public:
  using OneManifold::OneManifold;

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo&, btManifoldResult* result) override {
    const auto [box_object, plane_object] = ordered(first, second);
    const auto& box = *static_cast<const btBoxShape*>(box_object.getCollisionShape());
    const auto& plane = *static_cast<const btStaticPlaneShape*>(plane_object.getCollisionShape());
    const btTransform& plane_pose = plane_object.getWorldTransform();
    const btVector3 normal = plane_pose.getBasis() * plane.getPlaneNormal();
    const btScalar offset = plane.getPlaneConstant() + normal.dot(plane_pose.getOrigin());

    const btVector3 half = box.getHalfExtentsWithMargin();
    result->setPersistentManifold(manifold_);
    const btScalar height = normal.dot(box_object.getWorldTransform().getOrigin()) - offset;
    if (manifold_->getNumContacts() == 0 &&
        height > kFarFromPlane * half.length() + manifold_->getContactBreakingThreshold()) {
      return;
    }

    struct BoxCorner {
      btVector3 point;
      btScalar distance;
    };
    std::array<BoxCorner, 8> corners;
    for (unsigned i = 0; i < corners.size(); ++i) {
      const btVector3 sign(btScalar(i & 1 ? 1 : -1), btScalar(i & 2 ? 1 : -1), btScalar(i & 4 ? 1 : -1));
      corners[i].point = box_object.getWorldTransform() * (half * sign);
      corners[i].distance = normal.dot(corners[i].point) - offset;
    }
    std::partial_sort(corners.begin(), corners.begin() + kMostPoints, corners.end(),
                      [](const BoxCorner& a, const BoxCorner& b) { return a.distance < b.distance; });

    for (std::size_t i = 0; i < kMostPoints; ++i) {
      const auto& [point, distance] = corners[i];
      if (distance < manifold_->getContactBreakingThreshold()) {
        result->addContactPoint(normal, point - distance * normal, distance);
      }
    }
    result->refreshContactPoints();
  }
};

}  // namespace

void register_box_plane(btCollisionDispatcher& dispatcher) {
  static Make<BoxPlane> box_first(false);
  static Make<BoxPlane> plane_first(true);
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, &box_first);
  dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, &plane_first);
}

}  // namespace subworld::bullet
