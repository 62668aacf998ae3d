#pragma once

#include "model/contact.hpp"

#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <array>
#include <cstddef>
#include <span>

namespace subworld::bullet {

inline constexpr std::size_t kMostPoints = 4;  ///< of a manifold, in Bullet

/// Element size of Bullet's pool of algorithms, bytes. Bullet does not check it.
inline constexpr int kMostAlgorithmBytes = 256;

/// A contact point of this step.
struct Point {
  btVector3 on_b;     ///< m, world
  btScalar distance;  ///< m
  int feature;        ///< equal for the same pair of edges or corners
  /// Displacement of the point on the first body across the normal, m, for bodies that will touch later.
  btVector3 aside{0, 0, 0};
};

struct Points {
  btVector3 normal;  ///< from b to a
  std::array<Point, kMostPoints> points;
  std::size_t count = 0;
};

using Four = std::array<std::size_t, kMostPoints>;

/// The four of `count` points, ascending, that span the largest area, one of them a `deep` one. Four that were the
/// points of the last step (`was`) are chosen unless the area of others is larger by the ratio `better`.
template <std::size_t kMost, class Real, class Area>
[[nodiscard]] Four widest_four(std::size_t count, const std::array<bool, kMost>& was,
                               const std::array<bool, kMost>& deep, Real better, const Area& area_of) {
  Four best{0, 1, 2, 3}, f;
  Real most = -1;
  for (f[0] = 0; f[0] < count; ++f[0]) {
    for (f[1] = f[0] + 1; f[1] < count; ++f[1]) {
      for (f[2] = f[1] + 1; f[2] < count; ++f[2]) {
        for (f[3] = f[2] + 1; f[3] < count; ++f[3]) {
          if (!deep[f[0]] && !deep[f[1]] && !deep[f[2]] && !deep[f[3]]) continue;
          const bool same = was[f[0]] && was[f[1]] && was[f[2]] && was[f[3]];
          const Real area = area_of(f) * (same ? better : Real(1));
          if (area <= most) continue;
          most = area;
          best = f;
        }
      }
    }
  }
  return best;
}

/// Impulses of a point in the last sub-step, for a solver with small steps, N s.
struct LastPart {
  btScalar normal = 0, lateral_1 = 0, lateral_2 = 0;
};
/// They are stored in fields that only Bullet's own solvers use.
inline LastPart last_part_of(const btManifoldPoint& point) {
  return {point.m_contactMotion1, point.m_contactMotion2, point.m_frictionCFM};
}
inline void set_last_part(btManifoldPoint& point, const LastPart& last) {
  point.m_contactMotion1 = last.normal;
  point.m_contactMotion2 = last.lateral_1;
  point.m_frictionCFM = last.lateral_2;
}

/// Data of a point that pass to the next step.
struct LastPoint {
  btVector3 local_b;
  btScalar impulse, lateral_1, lateral_2;
  int feature;
  int life_time;
  LastPart last_part;
};

/// A point of two bodies as the engine reports it. `sign`: 1, or -1 where a is the second body of the manifold.
[[nodiscard]] Contact contact_of(const btRigidBody& a, const btRigidBody& b, const btManifoldPoint& point, double sign);

/// Fills a manifold with the points of this step, which continue with the impulses of the previous step.
class ManifoldWriter {
 public:
  /// `reach`: there are no points beyond this distance, and nearer points are merged, m. `same`: a point inherits
  /// impulses within this distance, m.
  ManifoldWriter(btPersistentManifold& manifold, btScalar reach, btScalar same)
      : manifold_(manifold), reach_(reach), same_(same) {}

  /// Empties the manifold and returns its points.
  std::span<const LastPoint> take(std::array<LastPoint, kMostPoints>& into);
  /// Omits points farther than `farthest` (m).
  void put(const Points& found, const btCollisionObject& first, const btCollisionObject& second, btScalar farthest);
  /// Each point inherits the impulses of the same point, or else of the nearest remaining one, of the previous step.
  void go_on_from(std::span<const LastPoint> old);

 private:
  int place_for(const btVector3& local_a);

  btPersistentManifold& manifold_;
  btScalar reach_, same_;
};

}  // namespace subworld::bullet
