#include "coupling/sync/blend.hpp"

#include "model/vectors.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// Sine of half a turn below which the series of sin(part * asin(sine)) / sine is used: two terms, exact to 1e-11.
constexpr double kSmallTurn = 0.03;

/// `part` of a turn: what slerp returns, without its three trigonometric functions where the turn is small.
Quat turned_partly(const Quat& turn, double part) noexcept {
  const double sine2 = turn.vec().squaredNorm();
  if (sine2 > kSmallTurn * kSmallTurn) return Quat::Identity().slerp(part, turn);
  const double p2 = part * part;
  const double ratio = part * (1.0 + (1.0 - p2) / 6.0 * sine2 * (1.0 + (9.0 - p2) / 20.0 * sine2));
  const Vec3 v = (turn.w() < 0.0 ? -ratio : ratio) * turn.vec();
  return Quat(std::sqrt(1.0 - v.squaredNorm()), v.x(), v.y(), v.z());
}

}  // namespace

Shift difference(const BodyState& from, const BodyState& to) noexcept {
  return {to.position - from.position, (to.orientation * from.orientation.conjugate()).normalized(),
          to.linear_velocity - from.linear_velocity, to.angular_velocity - from.angular_velocity};
}

BodyState shifted(const BodyState& state, const Shift& shift) noexcept {
  return {state.position + shift.position, (shift.rotation * state.orientation).normalized(),
          state.linear_velocity + shift.linear_velocity, state.angular_velocity + shift.angular_velocity};
}

Shift scaled(const Shift& shift, double part) noexcept {
  return {part * shift.position, turned_partly(shift.rotation, part), part * shift.linear_velocity,
          part * shift.angular_velocity};
}

BodyState blend(const BodyState& world, const BodyState& sub, double s) noexcept {
  if (s <= 0.0) return world;
  if (s >= 1.0) return sub;
  return {(1.0 - s) * world.position + s * sub.position, world.orientation.slerp(s, sub.orientation).normalized(),
          (1.0 - s) * world.linear_velocity + s * sub.linear_velocity,
          (1.0 - s) * world.angular_velocity + s * sub.angular_velocity};
}

BodyState advanced(const BodyState& state, double dt) noexcept {
  BodyState later = state;
  later.position += dt * state.linear_velocity;
  later.orientation = rotated(state.orientation, state.angular_velocity, dt);
  return later;
}

}  // namespace subworld
