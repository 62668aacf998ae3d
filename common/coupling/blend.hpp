#pragma once

#include "model/body.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"

namespace subworld {

/// The paper's s (4.3): how much of the sub-world's copy goes into a blend, 0 .. 1.
///   1 without border bodies; else 0 without contacts on the proxy; else 0 if the device's impulse is under the
///   threshold; else sqrt(impulse magnitudes on the proxy / impulse magnitudes in the sub-world).
/// A closed sub-world comes first: it has no drift to correct, and the world's coarser copy would only add error.
[[nodiscard]] double blend_weight(const Indicators& indicators, const PaperSettings& settings) noexcept;

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
