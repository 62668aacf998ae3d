#pragma once

#include "device_sim/driver.hpp"
#include "device_sim/drivers/tracking.hpp"
#include "model/tool_link.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

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
