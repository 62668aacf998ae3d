#pragma once

#include "model/messages/exchange.hpp"
#include "model/vectors.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

/// Where another user's device is by now. The acceleration of an arm lasts for some tenths of a second, so it is
/// observed and goes on, decaying (Singer 1970):
///   v(t) = v + a f,  x(t) = x + v t + a tau (t - f),  f = tau (1 - e^(-t / tau)).
/// with v as measured. The observer of a is the stationary Kalman filter for velocities with white noise, of the
/// bandwidth kBandwidth_rad_s. A velocity that jumps is none of an arm: it goes on as it is.
class PeerForecast {
 public:
  /// A new state of the device, of which the states ascend in time.
  void observe(const DeviceState& state) noexcept {
    const double dt = state.stamp_s - stamp_s_;
    if (dt == 0.0 && state.sender == sender_) return;
    const bool goes_on = state.sender == sender_ && dt > 0.0 && dt < kLongestGap_s;
    linear_.observe(state.linear_velocity, goes_on ? dt : 0.0, kJump_m_s);
    angular_.observe(state.angular_velocity, goes_on ? dt : 0.0, kJump_rad_s);
    stamp_s_ = state.stamp_s;
    sender_ = state.sender;
  }
  /// Moves the device by `simulated_s`, in which its own clock goes on by 1 / `rate` of it; its velocities are those
  /// then, in simulated time.
  void advance(DevicePose& device, double simulated_s, double rate) const noexcept {
    const double t_s = simulated_s / rate;
    device.pose.position += linear_.way(t_s);
    device.pose.orientation = rotated(device.pose.orientation, angular_.way(t_s), 1.0);
    device.linear_velocity = linear_.velocity_after(t_s) / rate;
    device.angular_velocity = angular_.velocity_after(t_s) / rate;
  }

 private:
  // Over five movements of 3 to 10 cm in 0.3 to 1 s, with velocities that encoders of 10 um give at 1 kHz: the least
  // error 20, 50 and 100 ms ahead (0.08, 0.42, 2.0 mm; without acceleration 0.14, 0.80, 3.0 mm).
  static constexpr double kMemory_s = 0.2;         ///< tau
  static constexpr double kBandwidth_rad_s = 150;  ///< of the observer
  static constexpr double kLongestGap_s = 0.02;    ///< between two states of one motion
  static constexpr double kJump_m_s = 0.02, kJump_rad_s = 0.2;

  struct Observer {
    Vec3 measured = Vec3::Zero();  ///< velocity
    Vec3 velocity = Vec3::Zero(), acceleration = Vec3::Zero();

    void observe(const Vec3& now, double dt, double jump) noexcept {
      measured = now;
      const Vec3 expected = velocity + lasting(dt) * acceleration, off = now - expected;
      if (dt == 0.0 || off.norm() > jump) {
        velocity = now;
        acceleration.setZero();
        return;
      }
      const double w = kBandwidth_rad_s * dt;
      velocity = expected + std::min(1.0, std::sqrt(2.0) * w) * off;
      acceleration = std::exp(-dt / kMemory_s) * acceleration + std::min(1.0, w * w) / dt * off;
    }
    [[nodiscard]] static double lasting(double t_s) noexcept { return kMemory_s * -std::expm1(-t_s / kMemory_s); }
    [[nodiscard]] Vec3 velocity_after(double t_s) const noexcept { return measured + lasting(t_s) * acceleration; }
    [[nodiscard]] Vec3 way(double t_s) const noexcept {
      return t_s * measured + kMemory_s * (t_s - lasting(t_s)) * acceleration;
    }
  };

  Observer linear_, angular_;
  double stamp_s_ = -INFINITY;
  std::uint64_t sender_ = 0;
};

}  // namespace subworld
