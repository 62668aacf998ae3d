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
  const Eigen::AngleAxisd a(turn);
  return a.angle() * a.axis();
}

/// The orientation after `time_s` (may be negative) at a constant angular velocity (world frame, rad/s).
[[nodiscard]] inline Quat rotated(const Quat& from, const Vec3& rate_rad_s, double time_s) noexcept {
  const double angle = rate_rad_s.norm() * time_s;
  return angle != 0.0 ? (Quat(Eigen::AngleAxisd(angle, rate_rad_s.normalized())) * from).normalized() : from;
}

}  // namespace subworld
