#include "coupling/schemes/world_side.hpp"

namespace subworld {

Wrench mean_wrench(const HapticReport& before, const HapticReport& now) noexcept {
  const double dt = now.stamp_s - before.stamp_s;
  if (dt <= 0.0) return {};
  return {(now.impulse_total.force - before.impulse_total.force) / dt,
          (now.impulse_total.torque - before.impulse_total.torque) / dt};
}

}  // namespace subworld
