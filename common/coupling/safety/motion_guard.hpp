#pragma once

#include "model/body.hpp"

namespace subworld {

/// How an admittance device is to move: a pose and the velocity there.
struct DeviceMotion {
  Pose pose;
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s
};

/// The last stage before an admittance device moves an operator, on each side of the wire and without trust in the
/// other: whatever goes in, what comes out is finite, no faster than the limits, and without jumps. While the source is
/// not trusted the motion comes to rest in kStop_s. What is within the limits passes bit by bit.
class MotionGuard {
 public:
  static constexpr double kStop_s = 0.02;

  /// `turn_limit_rad_s` bounds the turning likewise.
  MotionGuard(double speed_limit_m_s, double turn_limit_rad_s) noexcept
      : speed_limit_m_s_(speed_limit_m_s), turn_limit_rad_s_(turn_limit_rad_s) {}

  /// Call once per step of `dt` seconds. The first motion is where the device is.
  [[nodiscard]] DeviceMotion pass(const DeviceMotion& wanted, bool trusted, double dt) noexcept;

 private:
  double speed_limit_m_s_;
  double turn_limit_rad_s_;
  bool begun_ = false;
  DeviceMotion sent_;
};

/// An admittance device turns by the speed limit at this distance, m.
inline constexpr double kTurnRadius_m = 0.1;

}  // namespace subworld
