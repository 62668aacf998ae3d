#pragma once

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <cstdint>
#include <vector>

namespace subworld::bullet {

/// Fixed bodies side by side whose faces are flush form one surface: their seams do not push. A body that rests on a
/// face of one of them is above that face's plane. So a body wholly below the plane can push only along the plane's
/// normal: contacts with it in other directions are omitted.
class FlushBodies {
 public:
  /// Call when the contacts of a step are found.
  void omit_seams(btDispatcher& dispatcher);

 private:
  /// A movable body touches a fixed one.
  struct Touch {
    std::uint32_t id;  ///< of the movable body
    const btCollisionObject *movable, *fixed;
    btPersistentManifold* manifold;
  };
  void omit(const Touch& carrier, const Touch& other) const;

  std::vector<Touch> touches_;
  std::vector<std::uint8_t> fixed_touched_;  ///< number of fixed bodies that a movable body touches, by id
};

}  // namespace subworld::bullet
