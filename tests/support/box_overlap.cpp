#include "support/box_overlap.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace subworld {

namespace {

double half_width(const Vec3& axis, const Eigen::Matrix3d& turn, const Vec3& half_extents) {
  return (turn.transpose() * axis).cwiseAbs().dot(half_extents);
}

}  // namespace

double overlap_depth(const Body& a, const BodyState& at_a, const Body& b, const BodyState& at_b) {
  const Vec3 between = at_b.position - at_a.position;
  if (between.norm() > a.shape.half_extents.norm() + b.shape.half_extents.norm()) return -1.0;
  const Eigen::Matrix3d turn_a = at_a.orientation.toRotationMatrix();
  const Eigen::Matrix3d turn_b = at_b.orientation.toRotationMatrix();
  std::vector<Vec3> axes;
  for (int i = 0; i < 3; ++i) {
    axes.push_back(turn_a.col(i));
    axes.push_back(turn_b.col(i));
    for (int k = 0; k < 3; ++k) {
      const Vec3 across = turn_a.col(i).cross(turn_b.col(k));
      if (across.norm() > 1e-9) axes.push_back(across.normalized());
    }
  }
  double least = std::numeric_limits<double>::infinity();
  for (const Vec3& axis : axes) {
    const double reach =
        half_width(axis, turn_a, a.shape.half_extents) + half_width(axis, turn_b, b.shape.half_extents);
    least = std::min(least, reach - std::abs(between.dot(axis)));
  }
  return least;
}

}  // namespace subworld
