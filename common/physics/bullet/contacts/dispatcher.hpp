#pragma once

#include "physics/workers.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>

#include <span>
#include <vector>

namespace subworld::bullet {

/// Bullet's dispatcher, with a choice for the algorithms, and with threads.
class Dispatcher final : public btCollisionDispatcher {
 public:
  /// `ahead`: contacts of all bodies that may meet within a step are found, not of fast ones only. `workers` must
  /// outlive this object.
  Dispatcher(btCollisionConfiguration& configuration, bool ahead, Workers& workers)
      : btCollisionDispatcher(&configuration), looks_ahead(ahead), workers_(workers) {}

  /// Finds the contacts of these pairs.
  void find_contacts(std::span<btBroadphasePair* const> pairs, const btDispatcherInfo& info);
  void dispatchAllCollisionPairs(btOverlappingPairCache* cache, const btDispatcherInfo& info, btDispatcher*) override;

  const bool looks_ahead;

 private:
  Workers& workers_;
  std::vector<btBroadphasePair*> all_, independent_;  ///< independent: any thread finds their contacts
};

}  // namespace subworld::bullet
