#pragma once

#include "model/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace subworld {

using TriangleCorners = std::array<Vec3, 3>;  ///< of a triangle

/// Whether a triangle has the point, to `near_m`, and from there a way within it that leads along `up`. Then a contact
/// at the point with the normal `up` is none of the surface: it is at an inner edge, which the triangle continues.
[[nodiscard]] inline bool rises(const TriangleCorners& corners, const Vec3& point, const Vec3& up, double near_m) {
  constexpr double kAbove = 1e-3;  // sine: a triangle that rises more steeply is above a plane
  const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  if (std::abs(normal.dot(point - corners[0])) > near_m) return false;
  const Vec3 steepest = up - up.dot(normal) * normal;
  Vec3 way = steepest;
  std::size_t edges = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 outwards = (corners[(i + 1) % 3] - corners[i]).cross(normal).normalized();
    const double outside_m = outwards.dot(point - corners[i]);
    if (outside_m > near_m) return false;
    if (outside_m < -near_m) continue;
    ++edges;
    if (steepest.dot(outwards) > 0.0) way -= steepest.dot(outwards) * outwards;
  }
  if (edges < 2 || way == steepest) return way.norm() > kAbove;
  return std::ranges::any_of(corners, [&](const Vec3& corner) {
    const Vec3 there = corner - point;
    return up.dot(there) > kAbove * (there.norm() + near_m);
  });
}

}  // namespace subworld
