#pragma once

#include "model/body.hpp"
#include "model/types.hpp"

namespace subworld {

/// How far a point of a body may move in `time_s` by turning and by falling, m.
[[nodiscard]] inline double any_way_m(const BodyState& state, const Box& bounds, double gravity_m_s2,
                                      double time_s) noexcept {
  const double arm_m = 0.5 * (bounds.upper - bounds.lower).norm();
  return time_s * (arm_m * state.angular_velocity.norm() + 0.5 * time_s * gravity_m_s2);
}

/// Bounds of all places that a body may reach within `time_s` (s), whichever way it turns and falls.
[[nodiscard]] inline Box swept_bounds(const BodyState& state, const Box& bounds, double gravity_m_s2,
                                      double time_s) noexcept {
  return bounds.grown(any_way_m(state, bounds, gravity_m_s2, time_s) + time_s * state.linear_velocity.norm());
}

}  // namespace subworld
