#pragma once

#include "physics/bullet/contacts/contact_points.hpp"
#include "physics/bullet/contacts/dispatcher.hpp"
#include "physics/bullet/parts.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>

#include <new>
#include <utility>

namespace subworld::bullet {

/// Base of the collision algorithms of this folder. An algorithm is made for bodies `a` and `b`; with `swapped` Bullet
/// passes them the other way round.
class ContactAlgorithm : public btCollisionAlgorithm {
 public:
  ContactAlgorithm(const btCollisionAlgorithmConstructionInfo& info, bool swapped)
      : btCollisionAlgorithm(info), swapped_(swapped) {}

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) final {
    return btScalar(1);
  }

 protected:
  [[nodiscard]] bool looks_ahead() const { return static_cast<const Dispatcher*>(m_dispatcher)->looks_ahead; }
  /// Bodies `a` and `b`.
  [[nodiscard]] std::pair<const btCollisionObject&, const btCollisionObject&> ordered(
      const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second) const {
    if (swapped_) std::swap(first, second);
    return {*first->getCollisionObject(), *second->getCollisionObject()};
  }

 private:
  bool swapped_;
};

/// For contacts of two bodies or parts: they act on the bodies.
[[nodiscard]] inline btPersistentManifold* new_manifold(btDispatcher& dispatcher, const btCollisionObject& a,
                                                        const btCollisionObject& b) {
  btPersistentManifold* const made = dispatcher.getNewManifold(&a, &b);
  made->setBodies(&owner_of(a), &owner_of(b));
  return made;
}

/// An algorithm whose contacts are in one manifold.
class OneManifold : public ContactAlgorithm {
 public:
  OneManifold(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject& a, const btCollisionObject& b,
              bool swapped)
      : ContactAlgorithm(info, swapped), manifold_(new_manifold(*m_dispatcher, a, b)) {}
  ~OneManifold() override { m_dispatcher->releaseManifold(manifold_); }
  void getAllContactManifolds(btManifoldArray& all) final { all.push_back(manifold_); }

 protected:
  btPersistentManifold* manifold_;
};

/// Makes an algorithm in the dispatcher's memory.
template <class Algorithm>
struct Make final : btCollisionAlgorithmCreateFunc {
  explicit Make(bool swapped = false) { m_swapped = swapped; }
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* first,
                                                 const btCollisionObjectWrapper* second) override {
    static_assert(sizeof(Algorithm) <= kMostAlgorithmBytes);
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    const auto &one = *first->getCollisionObject(), &other = *second->getCollisionObject();
    return m_swapped ? new (memory) Algorithm(info, other, one, true) : new (memory) Algorithm(info, one, other, false);
  }
};

}  // namespace subworld::bullet
