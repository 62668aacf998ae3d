#include "physics/bullet/contacts/dispatcher.hpp"

#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btCollisionShape.h>

namespace subworld::bullet {

namespace {

const btCollisionObject& object_of(const btBroadphaseProxy& proxy) {
  return *static_cast<const btCollisionObject*>(proxy.m_clientObject);
}
btCollisionObjectWrapper wrapper_of(const btCollisionObject& object) {
  return {nullptr, object.getCollisionShape(), &object, object.getWorldTransform(), -1, -1};
}

/// Pairs of parts and of triangles make algorithms when they meet, from memory that all pairs share.
bool is_independent(const btCollisionObject& object) {
  const btCollisionShape& shape = *object.getCollisionShape();
  return !shape.isCompound() && (!shape.isConcave() || shape.isInfinite());
}

}  // namespace

void Dispatcher::find_contacts(std::span<btBroadphasePair* const> pairs, const btDispatcherInfo& info) {
  independent_.clear();
  for (btBroadphasePair* pair : pairs) {
    const btCollisionObject &a = object_of(*pair->m_pProxy0), &b = object_of(*pair->m_pProxy1);
    if (!is_independent(a) || !is_independent(b)) {
      defaultNearCallback(*pair, *this, info);
    } else if (needsCollision(&a, &b)) {
      if (pair->m_algorithm == nullptr) {
        const btCollisionObjectWrapper first = wrapper_of(a), second = wrapper_of(b);
        pair->m_algorithm = findAlgorithm(&first, &second, nullptr, BT_CONTACT_POINT_ALGORITHMS);
      }
      independent_.push_back(pair);
    }
  }
  constexpr std::size_t kGrain = 32;  // some microseconds
  workers_.run(independent_.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) defaultNearCallback(*independent_[i], *this, info);
  });
}

void Dispatcher::dispatchAllCollisionPairs(btOverlappingPairCache* cache, const btDispatcherInfo& info, btDispatcher*) {
  btBroadphasePairArray& pairs = cache->getOverlappingPairArray();
  all_.clear();
  for (int i = 0; i < pairs.size(); ++i) all_.push_back(&pairs[i]);
  find_contacts(all_, info);
}

}  // namespace subworld::bullet
