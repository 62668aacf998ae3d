#pragma once

#include "patch.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

#include <optional>

namespace subworld::bullet {

/// How a body moves during a step.
struct Sweep {
  Vec3 velocity;  ///< m/s
  Vec3 spin;      ///< rad/s

  explicit Sweep(const btCollisionObject& object);
  /// Where the body is after so many seconds.
  [[nodiscard]] Placed after(const Placed& start, double seconds) const;
};

/// Tells of two bodies whether they may pass each other within a step: their relative motion is longer than half of
/// what is inside both. Slower ones are found while they overlap, and pushed out on the side from which they came.
class FastPair {
 public:
  FastPair(const btCollisionObject& a, const btCollisionObject& b);

  /// At most how far the bodies move relative to each other within dt, m; 0 where that is not far.
  [[nodiscard]] double way(const btCollisionObject& a, const btCollisionObject& b, double dt) const;

 private:
  double far_;                ///< m
  double outer_a_, outer_b_;  ///< m
};

/// When two shapes first touch within dt, s: conservative advancement (Mirtich 1996), which takes the longest step in
/// which the gap cannot close, again and again until it is below `fine` (m).
[[nodiscard]] std::optional<double> first_touch(const Placed& a, const Sweep& sweep_a, const Placed& b,
                                                const Sweep& sweep_b, double dt, double fine);

/// A contact to come, seen from now: the points of a patch that will be there later, as far apart as they still are.
struct Ahead {
  Vec3 on_a, on_b;  ///< m
  double distance;  ///< along the patch's normal, m
};
[[nodiscard]] Ahead back_from(const PatchPoint& point, const Vec3& normal, const Placed& a_then, const Placed& a_now,
                              const Placed& b_then, const Placed& b_now);

}  // namespace subworld::bullet
