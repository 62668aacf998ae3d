#pragma once

#include "model/types.hpp"

#include <cmath>

namespace subworld {

/// `v`, no longer than `most`.
[[nodiscard]] inline Vec3 shortened(const Vec3& v, double most) noexcept {
  const double length = v.norm();
  return length > most ? Vec3(v * (most / length)) : v;
}

/// `to`, or the point in that direction that is `most` from `from`. Exactly `to` if that is no farther.
[[nodiscard]] inline Vec3 towards(const Vec3& from, const Vec3& to, double most) noexcept {
  const double distance = (to - from).norm();
  return distance <= most ? to : Vec3(from + (to - from) * (most / distance));
}

/// Axis times angle of a rotation along the shorter arc, rad.
[[nodiscard]] inline Vec3 rotation_vector(const Quat& turn) noexcept {
  const double sine = turn.vec().norm();
  if (!(sine > 0.0)) return Vec3::Zero();
  const double angle = 2.0 * std::atan2(sine, std::abs(turn.w()));
  return angle * (turn.vec() / (turn.w() < 0.0 ? -sine : sine));
}

/// The orientation after `time_s` (may be negative) at a constant angular velocity (world frame, rad/s).
[[nodiscard]] inline Quat rotated(const Quat& from, const Vec3& rate_rad_s, double time_s) noexcept {
  const double angle = rate_rad_s.norm() * time_s;
  return angle != 0.0 ? (Quat(Eigen::AngleAxisd(angle, rate_rad_s.normalized())) * from).normalized() : from;
}

/// Of a symmetric matrix: whether each leading minor is above zero.
[[nodiscard]] inline bool is_positive_definite(const Eigen::Matrix3d& m) noexcept {
  return m(0, 0) > 0.0 && m(0, 0) * m(1, 1) > m(0, 1) * m(0, 1) && m.col(0).cross(m.col(1)).dot(m.col(2)) > 0.0;
}

}  // namespace subworld
