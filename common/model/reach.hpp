#pragma once

#include "model/body.hpp"

namespace subworld {

/// As a hand may change its speed: fast reaching movements come to 5 g.
inline constexpr double kOperator_m_s2 = 50.0;
/// What is hit by something heavier leaves twice as fast.
inline constexpr double kHit = 2.0;

/// How far any point of a body may get within `time_s`, m: as it moves, by turning, and by an acceleration. `arm_m` is
/// the distance of its farthest point from its centre.
[[nodiscard]] inline double reach_m(const BodyState& state, double arm_m, double acceleration_m_s2,
                                    double time_s) noexcept {
  return time_s * (state.linear_velocity.norm() + arm_m * state.angular_velocity.norm()) +
         0.5 * time_s * time_s * acceleration_m_s2;
}

/// At most, from the centre of a body with these bounds to its farthest point.
[[nodiscard]] inline double arm_m(const Box& bounds) noexcept { return 0.5 * (bounds.upper - bounds.lower).norm(); }

/// Where a proxy may get within `time_s`, whatever its hand does.
[[nodiscard]] inline Box operator_reach(const Box& bounds, const BodyState& state, double time_s) noexcept {
  return bounds.grown(reach_m(state, arm_m(bounds), kOperator_m_s2, time_s));
}

}  // namespace subworld
