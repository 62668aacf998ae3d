#include "coupling/force_guard.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr double kFadeOut_s = 0.02;

}  // namespace

Wrench ForceGuard::pass(const Wrench& wanted, bool trusted, double dt) noexcept {
  if (trusted && wanted.force.allFinite() && wanted.torque.allFinite()) {
    last_ = saturated(wanted, limits_);
    gain_ = ramp_s_ > 0.0 ? std::min(1.0, gain_ + dt / ramp_s_) : 1.0;
  } else {
    gain_ = std::max(0.0, gain_ - dt / kFadeOut_s);
  }
  return {gain_ * last_.force, gain_ * last_.torque};
}

}  // namespace subworld
