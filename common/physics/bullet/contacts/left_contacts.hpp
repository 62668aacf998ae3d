#pragma once

#include "physics/bullet/contacts/contact_points.hpp"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace subworld::bullet {

/// `getUserIndex2()` of bodies that leave together.
inline constexpr int kLeaves = 1;
[[nodiscard]] bool leaves(const btCollisionObject& body);

/// Contact impulses of bodies that leave the engine, for bodies that return to exactly the same place, as after
/// sleeping. At another place the contact forces differ. A solver that starts without these impulses needs many steps
/// to support a pile: meanwhile the pile sinks in and is thrown back.
class LeftContacts {
 public:
  LeftContacts();

  /// Call before a body leaves. Takes as long as removing it from Bullet: both search all pairs.
  void keep(const btCollisionObject& body, btDispatcher& dispatcher);
  /// Call before the contacts are removed of all bodies that leave (kLeaves).
  void keep_leaving(btDispatcher& dispatcher);
  /// Call after a body has returned.
  void came(const btCollisionObject& body);
  /// Call when the contacts of a step are found: new contacts at stored places continue with the stored impulses.
  /// Impulses of other bodies stay stored until these return.
  void give_back(btDispatcher& dispatcher);

 private:
  struct Left {
    btVector3 place;  ///< on the second body, m, world
    /// Impulses on the body with the lower number, N s: along the normal, and across it in world coordinates; of the
    /// whole step and of its last sub-step.
    btScalar normal, last_normal;
    btVector3 across, last_across;
  };
  struct Pair {
    std::uint32_t low, high;  ///< numbers of the bodies
    std::size_t count;
    std::array<Left, kMostPoints> points;
  };
  void keep(const btPersistentManifold& manifold);
  [[nodiscard]] bool is_away(std::uint32_t body) const { return body < away_.size() && away_[body].has_value(); }

  std::vector<Pair> pairs_;
  std::vector<std::optional<btVector3>> away_;  ///< positions of the absent bodies, by id
  bool expects_ = false;                        ///< some bodies have returned to their place since the last step
};

}  // namespace subworld::bullet
