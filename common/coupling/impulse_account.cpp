#include "coupling/impulse_account.hpp"

#include "coupling/world_side.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

Wrench ImpulseAccount::pass(const HapticReport& before, const HapticReport& now, const ForceLimits& limits,
                            double until_s) noexcept {
  const double dt = until_s - std::exchange(until_s_, until_s);
  if (dt <= 0.0) return {};
  Wrench then = now.impulse_total;
  if (until_s != now.stamp_s) {
    const Wrench slope = mean_wrench(before, now);
    const double ahead_s = std::min(until_s - now.stamp_s, kLongestGuess_s);
    then.force += ahead_s * slope.force;
    then.torque += ahead_s * slope.torque;
  }
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
