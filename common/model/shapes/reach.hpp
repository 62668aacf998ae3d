#pragma once

#include "model/body.hpp"

namespace subworld {

/// Largest acceleration of an operator's hand: fast reaching movements come to 5 g.
inline constexpr double kOperator_m_s2 = 50.0;
/// Speed ratio: a body that is hit by a much heavier one leaves twice as fast.
inline constexpr double kHit = 2.0;

/// Bound on the distance that any point of a body may travel within `time_s`, m: by its velocity, by turning, and by an
/// acceleration. `arm_m` is the distance of its farthest point from its centre.
[[nodiscard]] inline double reach_m(const BodyState& state, double arm_m, double acceleration_m_s2,
                                    double time_s) noexcept {
  return time_s * (state.linear_velocity.norm() + arm_m * state.angular_velocity.norm()) +
         0.5 * time_s * time_s * acceleration_m_s2;
}

/// Upper bound of the distance from the centre of a body with these bounds to its farthest point, m.
[[nodiscard]] inline double arm_m(const Box& bounds) noexcept { return 0.5 * (bounds.upper - bounds.lower).norm(); }

/// Region that a proxy may reach within `time_s`, for any motion of its operator.
[[nodiscard]] inline Box operator_reach(const Box& bounds, const BodyState& state, double time_s) noexcept {
  return bounds.grown(reach_m(state, arm_m(bounds), kOperator_m_s2, time_s));
}

}  // namespace subworld
