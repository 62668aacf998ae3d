#include "coupling/tool/impulse_account.hpp"

#include "coupling/schemes/world_side.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

/// J(t)
Wrench impulse_at(const HapticReport& before, const HapticReport& now, double t_s) noexcept {
  Wrench impulse = now.impulse_total;
  if (t_s == now.stamp_s) return impulse;
  const Wrench slope = mean_wrench(before, now);
  const double ahead_s = std::min(t_s - now.stamp_s, kLongestGuess_s);
  impulse.force += ahead_s * slope.force;
  impulse.torque += ahead_s * slope.torque;
  return impulse;
}

}  // namespace

void ImpulseAccount::resume(const HapticReport& before, const HapticReport& now, double from_s) noexcept {
  applied_ = impulse_at(before, now, from_s);
  until_s_ = from_s;
}

void ImpulseAccount::count(const Wrench& instead, double until_s) noexcept {
  const double dt = until_s - std::exchange(until_s_, until_s);
  applied_.force += dt * instead.force;
  applied_.torque += dt * instead.torque;
}

Wrench ImpulseAccount::pass(const HapticReport& before, const HapticReport& now, const ForceLimits& limits,
                            double until_s) noexcept {
  const double dt = until_s - std::exchange(until_s_, until_s);
  if (dt <= 0.0) return {};
  const Wrench then = impulse_at(before, now, until_s);
  constexpr double kRounding = 1.0 + 1e-9;
  const Wrench mean{(then.force - applied_.force) / dt, (then.torque - applied_.torque) / dt};
  if (mean.force.norm() <= kRounding * limits.force_n && mean.torque.norm() <= kRounding * limits.torque_n_m) {
    applied_ = then;
    return mean;
  }
  const Wrench most = saturated(mean, limits);
  applied_.force += dt * most.force;
  applied_.torque += dt * most.torque;
  return most;
}

}  // namespace subworld
