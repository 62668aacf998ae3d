#include "coupling/safety/force_guard.hpp"

#include "model/vectors.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr double kLostRate = 2.0;     ///< factor of the rate limits: the largest wrench fades within kLost_s too
constexpr double kRounding_s = 1e-9;  ///< of the sum of steps

/// While soft: the time in which the largest force that the device can show is reached; 40 N at 0.1 N a millisecond.
constexpr double kFullScale_s = 0.4;

/// Part of the wrench that is left after so long without a trusted source.
double faded(double lost_s) noexcept {
  const double x = std::min(1.0, (lost_s + kRounding_s) / ForceGuard::kLost_s);
  return 1.0 - x * x * x;
}

/// Shortens the part of a force that accelerates the operator.
Vec3 with_power(const Vec3& force, const Vec3& velocity, double most_w) noexcept {
  const double power_w = force.dot(velocity);
  if (!(power_w > most_w)) return force;
  return force - (power_w - most_w) / velocity.squaredNorm() * velocity;
}

}  // namespace

OperatorLimits operator_limits_of(const DeviceSpec& device) noexcept {
  return {.wrench = limits_of(device),
          .force_rate_n_s = device.force_rate_limit_n_s.value_or(device.force_limit_n / DeviceSpec::kFullScale_s),
          .torque_rate_n_m_s = device.torque_limit_n_m / DeviceSpec::kFullScale_s,
          .power_w = device.power_limit_w.value_or(device.force_limit_n * DeviceSpec::kFastestPush_m_s)};
}

Wrench ForceGuard::follow(const Wrench& wanted, double dt) noexcept {
  if (soft_s_ <= 0.0) return wanted;
  const double part = dt / kFullScale_s;
  const Wrench next{towards(last_.force, wanted.force, part * limits_.wrench.force_n),
                    towards(last_.torque, wanted.torque, part * limits_.wrench.torque_n_m)};
  const bool caught_up = next.force == wanted.force && next.torque == wanted.torque;
  soft_s_ = caught_up ? soft_s_ - dt : std::max(soft_s_ - dt, dt);
  return next;
}

Wrench ForceGuard::pass(const Wrench& wanted, const Vec3& velocity, bool trusted, double dt) noexcept {
  declutching_ = declutching_ && gain_ > 0.0;
  const bool good = trusted && wanted.force.allFinite() && wanted.torque.allFinite();
  const bool ends = !good && loss_ == Loss::ends_force;
  const double left = faded(lost_s_);
  lost_s_ = ends ? lost_s_ + dt : 0.0;
  if (good && !declutching_) {
    last_ = follow(saturated(wanted, limits_.wrench), dt);
    gain_ = ramp_s_ > 0.0 ? std::min(1.0, gain_ + dt / ramp_s_) : 1.0;
  } else if (ends) {
    gain_ = left > 0.0 ? gain_ * faded(lost_s_) / left : 0.0;
  } else {
    gain_ = std::max(0.0, gain_ - dt / kFadeOut_s);
  }
  const Vec3 force =
      velocity.allFinite() ? with_power(gain_ * last_.force, velocity, limits_.power_w) : Vec3(gain_ * last_.force);
  const double rate = ends ? kLostRate * dt : dt;
  sent_ = {towards(sent_.force, force, rate * limits_.force_rate_n_s),
           towards(sent_.torque, gain_ * last_.torque, rate * limits_.torque_rate_n_m_s)};
  return sent_;
}

}  // namespace subworld
