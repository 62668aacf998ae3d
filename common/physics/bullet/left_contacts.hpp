#pragma once

#include "contact_points.hpp"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace subworld::bullet {

/// Impulses of bodies that leave the engine, for when they come back to exactly the same place, as bodies do that have
/// slept. Elsewhere other forces hold them. A solver that begins without them takes many steps to find what carries a
/// pile: meanwhile the pile sinks in and is thrown back.
class LeftContacts {
 public:
  LeftContacts();

  /// Before a body leaves. Takes as long as Bullet takes to remove it: both look at all pairs.
  void keep(const btCollisionObject& body, btDispatcher& dispatcher);
  /// After a body has come.
  void came(const btCollisionObject& body);
  /// Once the contacts of a step are found: new ones where a body left some go on with their impulses. What other
  /// bodies have left stays until they are back.
  void give_back(btDispatcher& dispatcher);

 private:
  struct Left {
    btVector3 place;  ///< on the second body, m, world
    /// N s, on the body with the lower number: along the normal, and across it in world coordinates. In the whole step
    /// and in its last part.
    btScalar normal, last_normal;
    btVector3 across, last_across;
  };
  struct Pair {
    std::uint32_t low, high;  ///< numbers of the bodies
    std::size_t count;
    std::array<Left, kMostPoints> points;
  };
  [[nodiscard]] bool is_away(std::uint32_t body) const { return body < away_.size() && away_[body].has_value(); }

  std::vector<Pair> pairs_;
  std::vector<std::optional<btVector3>> away_;  ///< where those are that have left, by number
  bool expects_ = false;                        ///< some are back where they were, since the last step
};

}  // namespace subworld::bullet
