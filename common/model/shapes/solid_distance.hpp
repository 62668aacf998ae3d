#pragma once

#include "model/body.hpp"

#include <array>
#include <utility>
#include <vector>

/// Distances between a solid, given by its closed surface with triangles outwards, and convex hulls.
namespace subworld {

using Corners = std::array<Vec3, 3>;

struct Plane {
  Vec3 normal;  ///< away from the side below
  double offset = 0.0;
  [[nodiscard]] double height(const Vec3& at) const { return normal.dot(at) - offset; }
};

[[nodiscard]] inline Vec3 crossed(const Corners& t) { return (t[1] - t[0]).cross(t[2] - t[0]); }
[[nodiscard]] Corners corners(const Mesh& mesh, std::size_t triangle);

/// Points spread evenly over the surface. `inside`: every second one is moved inwards, towards the middle.
[[nodiscard]] std::vector<Vec3> samples(const Mesh& mesh, std::size_t count, bool inside);

/// Planes of the faces of a hull. Two points that are nearly one make a face without a direction, which bounds nothing.
[[nodiscard]] std::vector<Plane> faces(const Mesh& hull);

/// The hull of some of the points, so that no other is higher than `near_m` above one of its faces. Empty if they are
/// nearly in one plane.
[[nodiscard]] Mesh hull_near(const std::vector<Vec3>& points, double near_m);

class SolidDistance {
 public:
  explicit SolidDistance(const Mesh& mesh);
  /// How often the surface surrounds the point: 1 inside, 0 outside (Van Oosterom and Strackee 1983).
  [[nodiscard]] double winding(const Vec3& p) const;
  /// Distance of a point from the solid; 0 where it is at most `at_least_m`.
  [[nodiscard]] double outside_m(const Vec3& p, double at_least_m) const;

 private:
  const Mesh& mesh_;
  std::vector<std::pair<Vec3, double>> balls_;  ///< around the triangles
  mutable std::size_t nearest_ = 0;             ///< the triangle that was nearest to the last point
};

/// Largest distance of points of the surface, so many for each hull, from the nearest hull.
[[nodiscard]] double uncovered_m(const Mesh& mesh, const std::vector<Mesh>& hulls, std::size_t samples_each);

}  // namespace subworld
