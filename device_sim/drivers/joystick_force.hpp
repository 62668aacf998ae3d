#pragma once

#include "device_sim/driver.hpp"

#include <linux/input.h>

#include <algorithm>
#include <cmath>

namespace subworld {

/// Position of an axis, m: the ends of its range are at -reach_m and reach_m.
[[nodiscard]] inline double axis_position_m(int value, int least, int most, double reach_m) noexcept {
  if (most <= least) return 0.0;
  const double ratio = 2.0 * (double(value) - least) / (double(most) - least) - 1.0;
  return reach_m * std::clamp(ratio, -1.0, 1.0);
}

/// Effect of a constant force in the plane of the stick; x right, y away from the operator. The kernel's directions are
/// 0x0000 towards the operator, 0x4000 left, 0x8000 away and 0xC000 right (linux/input.h, struct ff_effect). A force of
/// `full_n` has the level 0x7fff. `id`: -1 for a new effect.
[[nodiscard]] inline ff_effect constant_force(const std::array<double, 3>& force_n, double full_n, int id) noexcept {
  ff_effect effect{};
  effect.type = FF_CONSTANT;
  effect.id = static_cast<__s16>(id);
  const double size_n = std::hypot(force_n[0], force_n[1]);
  const double level = std::clamp(size_n / full_n, 0.0, 1.0);
  const double turns = std::atan2(-force_n[0], -force_n[1]) / (2.0 * M_PI);
  effect.direction = size_n > 0.0 ? static_cast<__u16>(static_cast<unsigned>(std::lround(turns * 65536.0)) & 0xffffU)
                                  : std::uint16_t{0};
  effect.u.constant.level = static_cast<__s16>(std::lround(level * 0x7fff));
  return effect;
}

}  // namespace subworld
