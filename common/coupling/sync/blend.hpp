#pragma once

#include "model/body.hpp"

namespace subworld {

/// What turns one state into another: a difference that can be applied to a later state.
struct Shift {
  Vec3 position = Vec3::Zero();          ///< m
  Quat rotation = Quat::Identity();      ///< applied on the left
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s
};

[[nodiscard]] Shift difference(const BodyState& from, const BodyState& to) noexcept;
[[nodiscard]] BodyState shifted(const BodyState& state, const Shift& shift) noexcept;
/// `part` of a shift, 0 .. 1.
[[nodiscard]] Shift scaled(const Shift& shift, double part) noexcept;

/// x = (1 - s) x_world + s x_sub, orientation along the shorter arc.
[[nodiscard]] BodyState blend(const BodyState& world, const BodyState& sub, double s) noexcept;

/// Where a body is after `dt` (s, may be negative) at constant velocity.
[[nodiscard]] BodyState advanced(const BodyState& state, double dt) noexcept;

}  // namespace subworld
