#include "coupling/safety/motion_guard.hpp"

#include "model/vectors.hpp"

#include <algorithm>

namespace subworld {

DeviceMotion MotionGuard::pass(const DeviceMotion& wanted, bool trusted, double dt) noexcept {
  const bool sound =
      finite({wanted.pose.position, wanted.pose.orientation, wanted.linear_velocity, wanted.angular_velocity});
  if (!begun_ && sound) {
    sent_.pose = wanted.pose;
    begun_ = true;
  }
  if (!trusted || !sound) {
    const double kept = std::max(0.0, 1.0 - dt / kStop_s);
    sent_.linear_velocity *= kept;
    sent_.angular_velocity *= kept;
    sent_.pose.position += dt * sent_.linear_velocity;
    sent_.pose.orientation = rotated(sent_.pose.orientation, dt * sent_.angular_velocity, 1.0);
    return sent_;
  }
  // A part more than the limit, so that a motion at the limit does not fall behind by rounding.
  constexpr double kRoundingError = 1e-9;
  const double most_m = dt * speed_limit_m_s_ * (1.0 + kRoundingError);
  const double most_rad = dt * turn_limit_rad_s_ * (1.0 + kRoundingError);
  const Vec3 turn = rotation_vector(wanted.pose.orientation * sent_.pose.orientation.conjugate());
  sent_.pose.position = towards(sent_.pose.position, wanted.pose.position, most_m);
  sent_.pose.orientation = turn.norm() <= most_rad ? wanted.pose.orientation
                                                   : rotated(sent_.pose.orientation, shortened(turn, most_rad), 1.0);
  sent_.linear_velocity = shortened(wanted.linear_velocity, speed_limit_m_s_);
  sent_.angular_velocity = shortened(wanted.angular_velocity, turn_limit_rad_s_);
  return sent_;
}

}  // namespace subworld
