#include "coupling/force_guard.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr double kFadeOut_s = 0.02;
/// While soft: the time in which the largest force that the device can show is reached; 40 N at 0.1 N a millisecond.
constexpr double kFullScale_s = 0.4;

Vec3 towards(const Vec3& from, const Vec3& to, double most) noexcept {
  const double distance = (to - from).norm();
  return distance <= most ? to : Vec3(from + (to - from) * (most / distance));
}

}  // namespace

Wrench ForceGuard::follow(const Wrench& wanted, double dt) noexcept {
  if (soft_s_ <= 0.0) return wanted;
  const double part = dt / kFullScale_s;
  const Wrench next{towards(last_.force, wanted.force, part * limits_.force_n),
                    towards(last_.torque, wanted.torque, part * limits_.torque_n_m)};
  const bool caught_up = next.force == wanted.force && next.torque == wanted.torque;
  soft_s_ = caught_up ? soft_s_ - dt : std::max(soft_s_ - dt, dt);
  return next;
}

Wrench ForceGuard::pass(const Wrench& wanted, bool trusted, double dt) noexcept {
  letting_go_ = letting_go_ && gain_ > 0.0;
  if (trusted && !letting_go_ && wanted.force.allFinite() && wanted.torque.allFinite()) {
    last_ = follow(saturated(wanted, limits_), dt);
    gain_ = ramp_s_ > 0.0 ? std::min(1.0, gain_ + dt / ramp_s_) : 1.0;
  } else {
    gain_ = std::max(0.0, gain_ - dt / kFadeOut_s);
  }
  return {gain_ * last_.force, gain_ * last_.torque};
}

}  // namespace subworld
