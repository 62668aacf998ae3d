#pragma once

#include "physics/bullet/contacts/patch.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

#include <optional>

namespace subworld::bullet {

/// Motion of a body during a step.
struct Sweep {
  Vec3 velocity;  ///< m/s
  Vec3 spin;      ///< rad/s

  explicit Sweep(const btCollisionObject& object);
  /// Pose after this time.
  [[nodiscard]] Placed after(const Placed& start, double seconds) const;
};

/// Finds pairs of bodies that may pass through each other within a step: their relative motion exceeds half of the
/// radius inside both shapes. Slower pairs are detected while they overlap, and separate on the side from which they
/// came.
class FastPair {
 public:
  FastPair(const btCollisionObject& a, const btCollisionObject& b);

  /// Upper bound of the relative motion of the bodies within dt, m; 0 if it is small.
  [[nodiscard]] double way(const btCollisionObject& a, const btCollisionObject& b, double dt) const;
  /// The upper bound itself.
  [[nodiscard]] double motion(const btCollisionObject& a, const btCollisionObject& b, double dt) const;

 private:
  double far_;                ///< m
  double outer_a_, outer_b_;  ///< m
};

/// Time within dt at which two shapes first touch, s. Conservative advancement (Mirtich 1996): repeats the longest time
/// in which the gap cannot close until the gap is below `fine` (m).
[[nodiscard]] std::optional<double> first_touch(const Placed& a, const Sweep& sweep_a, const Placed& b,
                                                const Sweep& sweep_b, double dt, double fine);

/// Whether two separate shapes do not touch within dt although their contact would stop them: a peg passes the edge of
/// its hole. `patch`: of a and b now.
[[nodiscard]] bool passes_by(const Patch& patch, const Placed& a, const Sweep& sweep_a, const Placed& b,
                             const Sweep& sweep_b, double dt, double fine);

/// A future contact in present coordinates: the points of a later patch, at their present distance.
struct Ahead {
  Vec3 on_a, on_b;  ///< m
  double distance;  ///< along the patch's normal, m
};
[[nodiscard]] Ahead back_from(const PatchPoint& point, const Vec3& normal, const Placed& a_then, const Placed& a_now,
                              const Placed& b_then, const Placed& b_now);

}  // namespace subworld::bullet
