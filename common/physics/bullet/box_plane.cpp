#include "box_plane.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>

#include <algorithm>
#include <array>
#include <new>

namespace subworld::bullet {

namespace {

constexpr std::size_t kMostPoints = 4;
/// A box farther from the plane than this factor times its half diagonal has no touching corner, whatever the rounding.
constexpr auto kFar = btScalar(1.001);

class BoxPlane final : public btCollisionAlgorithm {
 public:
  BoxPlane(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject* box,
           const btCollisionObject* plane, bool swapped)
      : btCollisionAlgorithm(info), swapped_(swapped), manifold_(m_dispatcher->getNewManifold(box, plane)) {}
  ~BoxPlane() override { m_dispatcher->releaseManifold(manifold_); }

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo&, btManifoldResult* result) override {
    const btCollisionObjectWrapper& box_object = swapped_ ? *second : *first;
    const btCollisionObjectWrapper& plane_object = swapped_ ? *first : *second;
    const auto& box = *static_cast<const btBoxShape*>(box_object.getCollisionShape());
    const auto& plane = *static_cast<const btStaticPlaneShape*>(plane_object.getCollisionShape());
    const btTransform& plane_pose = plane_object.getWorldTransform();
    const btVector3 normal = plane_pose.getBasis() * plane.getPlaneNormal();
    const btScalar offset = plane.getPlaneConstant() + normal.dot(plane_pose.getOrigin());

    const btVector3 half = box.getHalfExtentsWithMargin();
    result->setPersistentManifold(manifold_);
    const btScalar height = normal.dot(box_object.getWorldTransform().getOrigin()) - offset;
    if (manifold_->getNumContacts() == 0 && height > kFar * half.length() + manifold_->getContactBreakingThreshold()) {
      return;
    }

    struct Corner {
      btVector3 point;
      btScalar distance;
    };
    std::array<Corner, 8> corners;
    for (unsigned i = 0; i < corners.size(); ++i) {
      const btVector3 sign(btScalar(i & 1 ? 1 : -1), btScalar(i & 2 ? 1 : -1), btScalar(i & 4 ? 1 : -1));
      corners[i].point = box_object.getWorldTransform() * (half * sign);
      corners[i].distance = normal.dot(corners[i].point) - offset;
    }
    std::partial_sort(corners.begin(), corners.begin() + kMostPoints, corners.end(),
                      [](const Corner& a, const Corner& b) { return a.distance < b.distance; });

    for (std::size_t i = 0; i < kMostPoints; ++i) {
      const auto& [point, distance] = corners[i];
      if (distance < manifold_->getContactBreakingThreshold()) {
        result->addContactPoint(normal, point - distance * normal, distance);
      }
    }
    result->refreshContactPoints();
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return btScalar(1);
  }
  void getAllContactManifolds(btManifoldArray& all) override { all.push_back(manifold_); }

 private:
  bool swapped_;
  btPersistentManifold* manifold_;
};

struct MakeBoxPlane final : btCollisionAlgorithmCreateFunc {
  explicit MakeBoxPlane(bool plane_first) { m_swapped = plane_first; }
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* first,
                                                 const btCollisionObjectWrapper* second) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(BoxPlane));
    const auto* box = (m_swapped ? second : first)->getCollisionObject();
    const auto* plane = (m_swapped ? first : second)->getCollisionObject();
    return new (memory) BoxPlane(info, box, plane, m_swapped);
  }
};

}  // namespace

void register_box_plane(btCollisionDispatcher& dispatcher) {
  static MakeBoxPlane box_first(false);
  static MakeBoxPlane plane_first(true);
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE, &box_first);
  dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, &plane_first);
}

}  // namespace subworld::bullet
