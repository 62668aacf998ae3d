#pragma once

#include "device_sim/driver.hpp"
#include "model/tool_link.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace subworld {

/// Follows poses that come at the low and uneven rate of a page, so that the device's own pose is smooth.
///
/// | symbol | unit | meaning | value |
/// |---|---|---|---|
/// | r | m | the newest pose that was received | |
/// | x, v, a | m, m/s, m/s^2 | the pose of the device and its derivatives | |
/// | w | rad/s | rate of the tracking | 50 |
/// | V | m/s, rad/s | largest speed | 1, 10 |
/// | A | m/s^2, rad/s^2 | largest acceleration | 20, 200 |
///
///   a = w^2 (r - x) - 2 w v   (1)   critically damped; |a| is limited to A, then |v| to V
///
/// A motion of constant velocity is followed with the lag 2 / w = 40 ms. A page that sends f poses a second adds half
/// an interval, 1 / (2 f): 8 ms at 60 Hz. From the speed V, (1) brakes with at most w V / e = 18.4 m/s^2, which is
/// below A: the device does not run past r. At w = 50 rad/s a motion of 0.2 m/s at 60 Hz has a ripple of 0.02 mm, which
/// is 0.02 N at 1000 N/m; at 100 rad/s it is four times that.
class PoseTracking {
 public:
  using Vector = Eigen::Vector3d;
  using Turn = Eigen::Quaterniond;

  static constexpr double kRate_rad_s = 50.0;
  static constexpr double kLag_s = 2.0 / kRate_rad_s;
  static constexpr double kSpeed_m_s = 1.0, kAcceleration_m_s2 = 20.0;
  static constexpr double kTurn_rad_s = 10.0, kTurnAcceleration_rad_s2 = 200.0;

  /// What is followed from now on. Finite; a unit quaternion.
  void aim(const Vector& position, const Turn& orientation) noexcept {
    aim_position_ = position;
    aim_orientation_ = orientation;
  }
  /// Rests where it is.
  void stop() noexcept {
    velocity_.setZero();
    turning_.setZero();
    aim(position_, orientation_);
  }
  void advance(double dt) noexcept {
    constexpr double kLongest_s = 1.5e-3;  // a late reading is divided
    const int steps = std::max(1, static_cast<int>(std::ceil(dt / kLongest_s)));
    for (int i = 0; i < steps; ++i) step(dt / steps);
  }

  [[nodiscard]] const Vector& position() const noexcept { return position_; }
  [[nodiscard]] const Vector& velocity() const noexcept { return velocity_; }
  [[nodiscard]] const Turn& orientation() const noexcept { return orientation_; }
  [[nodiscard]] const Vector& turning() const noexcept { return turning_; }

 private:
  static Vector limited(const Vector& v, double most) noexcept {
    const double size = v.norm();
    return size > most ? Vector(v * (most / size)) : v;
  }
  /// (1); returns the new velocity.
  static Vector followed(const Vector& gap, const Vector& velocity, double fastest, double hardest,
                         double dt) noexcept {
    const Vector wanted = kRate_rad_s * kRate_rad_s * gap - 2.0 * kRate_rad_s * velocity;
    return limited(velocity + dt * limited(wanted, hardest), fastest);
  }
  void step(double dt) noexcept {
    velocity_ = followed(aim_position_ - position_, velocity_, kSpeed_m_s, kAcceleration_m_s2, dt);
    position_ += dt * velocity_;
    const Eigen::AngleAxisd gap(aim_orientation_ * orientation_.conjugate());
    const double angle = std::remainder(gap.angle(), 2.0 * M_PI);
    turning_ = followed(angle * gap.axis(), turning_, kTurn_rad_s, kTurnAcceleration_rad_s2, dt);
    if (const double rate = turning_.norm(); rate > 0.0)
      orientation_ = (Turn(Eigen::AngleAxisd(rate * dt, turning_ / rate)) * orientation_).normalized();
  }

  Vector position_ = Vector::Zero(), velocity_ = Vector::Zero(), turning_ = Vector::Zero();
  Turn orientation_ = Turn::Identity();
  Vector aim_position_ = Vector::Zero();
  Turn aim_orientation_ = Turn::Identity();
};

/// The tool of a user as pages hold it, one after the other. Until the first one takes it, it rests at 0. Poses count
/// from where a page takes the tool: the tool goes on from where it is. A page that releases it, or sends no pose for
/// `kQuiet_s`, holds it no more: there is no reading until a page takes it again. Time is passed in.
class BrowserTool {
 public:
  static constexpr double kQuiet_s = 0.25;

  explicit BrowserTool(double workspace_m) : workspace_m_(workspace_m) {}

  /// Ignores a pose that is not finite, or whose orientation is no unit quaternion.
  void receive(const PoseDatagram& pose, double now_s) noexcept {
    if ((pose.flags & kReleased) != 0) return release();
    const PoseTracking::Vector at(pose.position_m[0], pose.position_m[1], pose.position_m[2]);
    const double* const q = pose.orientation;
    const PoseTracking::Turn turn(q[0], q[1], q[2], q[3]);
    constexpr double kUnit = 1e-3;
    if (!at.allFinite() || !(std::abs(turn.norm() - 1.0) < kUnit)) return;
    const PoseTracking::Turn unit = turn.normalized();
    if (!held_) {
      held_ = taken_ = true;
      from_ = tracking_.position() - at;
      turned_from_ = (unit.conjugate() * tracking_.orientation()).normalized();
    }
    heard_s_ = now_s;
    buttons_ = pose.buttons;
    tracking_.aim((from_ + at).cwiseMax(-workspace_m_).cwiseMin(workspace_m_), (unit * turned_from_).normalized());
  }

  /// False where no page holds the tool any more.
  bool read(double now_s, DriverReading& reading) noexcept {
    constexpr double kLongest_s = 0.02;  // a thread that was halted has not moved the tool meanwhile
    const double passed_s = std::clamp(now_s - read_s_, 0.0, kLongest_s);
    read_s_ = now_s;
    if (held_ && now_s - heard_s_ > kQuiet_s) release();
    if (taken_ && !held_) return false;
    tracking_.advance(passed_s);
    const PoseTracking::Turn& q = tracking_.orientation();
    reading = {.time_s = now_s, .orientation = {q.w(), q.x(), q.y(), q.z()}, .buttons = buttons_};
    for (int i = 0; i < 3; ++i) {
      const auto at = static_cast<std::size_t>(i);
      reading.position_m[at] = tracking_.position()[i];
      reading.linear_velocity_m_s[at] = tracking_.velocity()[i];
      reading.angular_velocity_rad_s[at] = tracking_.turning()[i];
    }
    return true;
  }

  [[nodiscard]] bool held() const noexcept { return held_; }

 private:
  void release() noexcept {
    held_ = false;
    buttons_ = 0;
    tracking_.stop();
  }

  double workspace_m_;
  PoseTracking tracking_;
  PoseTracking::Vector from_ = PoseTracking::Vector::Zero();
  PoseTracking::Turn turned_from_ = PoseTracking::Turn::Identity();
  bool held_ = false, taken_ = false;
  double heard_s_ = 0.0, read_s_ = 0.0;
  std::uint32_t buttons_ = 0;
};

}  // namespace subworld
