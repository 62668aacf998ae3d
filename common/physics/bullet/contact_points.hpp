#pragma once

#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <array>
#include <cstddef>
#include <span>

namespace subworld::bullet {

inline constexpr std::size_t kMostPoints = 4;  ///< of a manifold, in Bullet

/// Bullet's pool of algorithms must be made for elements so large: it does not look.
inline constexpr int kMostAlgorithmBytes = 256;

/// A contact point that was found in this step.
struct Point {
  btVector3 on_b;     ///< m, world
  btScalar distance;  ///< m
  int feature;        ///< the same for the same pair of edges or corners
  /// Of the point on the first body, across the normal, m: where they will touch only later.
  btVector3 aside{0, 0, 0};
};

struct Points {
  btVector3 normal;  ///< from b to a
  std::array<Point, kMostPoints> points;
  std::size_t count = 0;
};

/// Impulses of a point in the last part of a step, for a solver that takes steps in parts, N s.
struct LastPart {
  btScalar normal = 0, lateral_1 = 0, lateral_2 = 0;
};
/// They are kept in fields that Bullet's own solvers would use.
inline LastPart last_part_of(const btManifoldPoint& point) {
  return {point.m_contactMotion1, point.m_contactMotion2, point.m_frictionCFM};
}
inline void set_last_part(btManifoldPoint& point, const LastPart& last) {
  point.m_contactMotion1 = last.normal;
  point.m_contactMotion2 = last.lateral_1;
  point.m_frictionCFM = last.lateral_2;
}

/// What a point of the step before leaves to the next.
struct LastPoint {
  btVector3 local_b;
  btScalar impulse, lateral_1, lateral_2;
  int feature;
  int life_time;
  LastPart last_part;
};

/// Fills a manifold with the points of this step, which go on with the impulses of the step before.
class ManifoldWriter {
 public:
  /// `reach`: from here on there are no points; points nearer to each other are one, m. `same`: within it a point goes
  /// on with another's impulses, m.
  ManifoldWriter(btPersistentManifold& manifold, btScalar reach, btScalar same)
      : manifold_(manifold), reach_(reach), same_(same) {}

  /// Empties the manifold.
  std::span<const LastPoint> take(std::array<LastPoint, kMostPoints>& into);
  /// Points farther than `farthest` are left out.
  void put(const Points& found, const btCollisionObject& first, const btCollisionObject& second, btScalar farthest);
  /// Gives each point what the same one, or else the nearest that is left, carried in the step before.
  void go_on_from(std::span<const LastPoint> old);

 private:
  int place_for(const btVector3& local_a);

  btPersistentManifold& manifold_;
  btScalar reach_, same_;
};

}  // namespace subworld::bullet
