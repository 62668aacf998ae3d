#include "coupling/motion_guard.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

Quat turned(const Quat& from, const Vec3& by) noexcept {
  const double angle = by.norm();
  return angle > 0.0 ? (Quat(Eigen::AngleAxisd(angle, by / angle)) * from).normalized() : from;
}

}  // namespace

Vec3 bounded(const Vec3& v, double limit) noexcept {
  const double length = v.norm();
  return length > limit ? Vec3(v * (limit / length)) : v;
}

Vec3 rotation_vector(const Quat& turn) noexcept {
  const Eigen::AngleAxisd a(turn);
  return (a.angle() > M_PI ? a.angle() - 2.0 * M_PI : a.angle()) * a.axis();
}

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
    sent_.pose.orientation = turned(sent_.pose.orientation, dt * sent_.angular_velocity);
    return sent_;
  }
  // A part more than the limit, so that a motion at the limit does not fall behind by rounding.
  constexpr double kRoundingError = 1e-9;
  const double most_m = dt * speed_limit_m_s_ * (1.0 + kRoundingError);
  const double most_rad = dt * turn_limit_rad_s_ * (1.0 + kRoundingError);
  const Vec3 way = wanted.pose.position - sent_.pose.position;
  const Vec3 turn = rotation_vector(wanted.pose.orientation * sent_.pose.orientation.conjugate());
  sent_.pose.position = way.norm() <= most_m ? wanted.pose.position : Vec3(sent_.pose.position + bounded(way, most_m));
  sent_.pose.orientation =
      turn.norm() <= most_rad ? wanted.pose.orientation : turned(sent_.pose.orientation, bounded(turn, most_rad));
  sent_.linear_velocity = bounded(wanted.linear_velocity, speed_limit_m_s_);
  sent_.angular_velocity = bounded(wanted.angular_velocity, turn_limit_rad_s_);
  return sent_;
}

}  // namespace subworld
