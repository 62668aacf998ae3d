#include "physics/shells/settling.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

/// Least friction of bodies that settle: on smooth contacts the damping would brake sliding more than friction does.
constexpr double kLeastFriction = 0.1;

bool rolls(const Shape& shape) noexcept {
  return shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder;
}

}  // namespace

double moved_m(const BodyState& from, const BodyState& to, double arm_m) {
  return (to.position - from.position).norm() + arm_m * to.orientation.angularDistance(from.orientation);
}

Settling::Settling(const Scene& scene, bool asked)
    : scene_(scene), asked_(asked), gravity_m_s2_(scene.settings.world.gravity.norm()), things_(scene.bodies.size()) {}

void Settling::add(const Body& body, double thickness_m, double arm_m, bool may) {
  Thing& thing = things_[index(body.id)];
  thing.arm_m = arm_m;
  thing.place_m = kPlace * thickness_m;
  const bool settles = asked_ && may && body.gravity && !rolls(body.shape);
  thing.calm_m_s = settles ? std::sqrt(2.0 * gravity_m_s2_ * kLift * thickness_m) : 0.0;
  thing.calm_s = 0.0;
}

void Settling::watch(BodyId id, const BodyState& now, double speed_m_s, double dt) {
  Thing& thing = things_[index(id)];
  thing.calm_s = speed_m_s < thing.calm_m_s ? thing.calm_s + dt : 0.0;
  if (thing.calm_s > dt) {
    follow_turns(thing, now);
  } else {
    thing.turn = thing.farthest = now;
    thing.farthest_m = thing.between_turns_m = 0.0;
  }
  if (!thing.settles) return;
  thing.settled_s += dt;
  if (moved_m(thing.place, now, thing.arm_m) <= thing.place_m) return;
  thing.settles = false;
  restart(id);
  thing.patience_s *= 2.0;
}

void Settling::follow_turns(Thing& thing, const BodyState& now) {
  double way_m = moved_m(thing.turn, now, thing.arm_m);
  if (way_m > thing.farthest_m) {
    thing.farthest = now;
    thing.farthest_m = way_m;
  } else if (way_m < kTurned * thing.farthest_m) {
    thing.between_turns_m = thing.farthest_m;
    thing.turn = std::exchange(thing.farthest, now);
    thing.farthest_m = way_m = moved_m(thing.turn, now, thing.arm_m);
  }
  thing.oscillates = way_m <= kGrowth * thing.between_turns_m;
}

void Settling::restart(BodyId id) { things_[index(id)].calm_s = things_[index(id)].settled_s = 0.0; }

void Settling::begin_contacts(std::span<const BodyId> awake) {
  for (const BodyId id : awake) things_[index(id)].touches = things_[index(id)].slips = false;
}

void Settling::touches(const Contact& contact) {
  if (contact.normal_impulse > 0.0) things_[index(contact.a)].touches = things_[index(contact.b)].touches = true;
  const Body &a = scene_.body(contact.a), &b = scene_.body(contact.b);
  if (in_contact(a.material, b.material, scene_.settings.world.pairs).friction >= kLeastFriction) return;
  for (const BodyId id : {contact.a, contact.b}) things_[index(id)].slips = true;
}

void Settling::judge(std::span<const BodyId> together, bool sways, bool in_reach, const Engine& engine) {
  if (!asked_) return;
  const bool calm = std::ranges::all_of(together, [&](BodyId id) { return things_[index(id)].is_calm(); });
  for (const BodyId id : together) {
    Thing& thing = things_[index(id)];
    if (in_reach || !thing.is_calm()) thing.settled_s = 0.0;
    thing.settles = calm && !in_reach;
    thing.is_damped = thing.settles && sways;
    if (thing.settled_s == 0.0) thing.place = engine.state(id);
  }
}

void Settling::damp(std::span<const BodyId> awake, Engine& engine, double dt) const {
  if (!asked_) return;
  const double left = std::exp(-kSettling_per_s * dt);
  for (const BodyId id : awake) {
    const Thing& thing = things_[index(id)];
    if (!thing.settles || !thing.is_damped || !thing.oscillates) continue;
    const BodyState now = engine.state(id);
    engine.set_velocity(id, left * now.linear_velocity, left * now.angular_velocity);
  }
}

}  // namespace subworld
