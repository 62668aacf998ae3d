#include "physics/wasm/module_engine.hpp"

#include "physics/gyroscope.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace subworld::wasm {

namespace {

/// A point is the same one as in the previous sub-step if it is within this distance, relative to the smallest body.
constexpr double kReachRatio = 0.1;

/// Handles of a body in a checkpoint.
struct Handles {
  std::uint64_t body, shape;
};

/// The state after an impulse (N s) and an angular impulse (N m s) about the centre of mass.
BodyState accelerated(const Slot& slot, BodyState state, const Vec3& impulse, const Vec3& angular) {
  state.linear_velocity += impulse / slot.mass;
  if (slot.rotates && !angular.isZero(0.0)) state.angular_velocity += spun_up(state.orientation, slot.inertia, angular);
  return state;
}

}  // namespace

void ModuleEngine::create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) {
  if (body.shape.kind == ShapeKind::compound)
    refuse_body(name(), body, "has several parts; use bullet, bullet_float or ode");
  if (body.group != 0) refuse_body(name(), body, "has a collision_group; use bullet, bullet_float or ode");
  if (body.is_driven()) refuse_body(name(), body, "has a surface that moves; use bullet, bullet_float or ode");
  refuse_turning_friction(name(), body, {});
  make(slot, body, state, collides);
  if (slot.fixed) return;
  const Box size = bounds_of(slot);
  reach_ = std::min(reach_, kReachRatio * (size.upper - size.lower).minCoeff());
}

BodyState ModuleEngine::state_of(const Slot& slot) const {
  if (slot.known) return slot.after;
  BodyState state = read(slot);
  if (slot.fixed) {
    state.linear_velocity = slot.after.linear_velocity;
    state.angular_velocity = slot.after.angular_velocity;
  }
  return state;
}

Box ModuleEngine::bounds_of(const Slot& slot) const {
  if (slot.shape_kind == ShapeKind::plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
  return read_bounds(slot);
}

void ModuleEngine::place(Slot& slot, const BodyState& state) {
  put_pose(slot, state.position, state.orientation);
  put_velocity(slot, state.linear_velocity, state.angular_velocity);
}

void ModuleEngine::put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) {
  if (slot.fixed) {
    slot.after.linear_velocity = linear;
    slot.after.angular_velocity = angular;
  } else {
    put_velocities(slot, linear, angular);
    slot.known = false;
  }
}

void ModuleEngine::push(Slot& slot, const Vec3& impulse, const Vec3& point) {
  const BodyState now = state_of(slot);
  const BodyState then = accelerated(slot, now, impulse, (point - now.position).cross(impulse));
  put_velocity(slot, then.linear_velocity, then.angular_velocity);
}

void ModuleEngine::step(double dt) {
  // The friction of a step with several sub-steps is their sum, so each is estimated. That of a single sub-step is
  // estimated on request.
  has_friction_ = substeps(dt) > 1;
  step_in_parts(dt, [this](double h, int number) {
    apply_loads(h);
    clock_.ends(&EngineTimes::exchange_s);
    simulate(h);
    clock_.ends(&EngineTimes::solving_s);
    for (const std::uint32_t id : movable_) {
      slots_[id].after = read(slots_[id]);
      slots_[id].known = true;
    }
    found_.clear();
    collect();
    clock_.ends(&EngineTimes::exchange_s);
    if (!has_friction_) return;
    estimate_friction();
    clock_.ends(&EngineTimes::friction_s);
    for (const Contact& c : found_) contacts_.add(c, number, reach_);
  });
  if (has_friction_) return;
  contacts_.take(found_);
  clock_.ends(&EngineTimes::totals_s);
}

void ModuleEngine::apply_loads(double h) {
  stepped_.resize(slots_.size());
  for (const std::uint32_t id : movable_) {
    const Slot& slot = slots_[id];
    Load next{h, state_of(slot), slot.rotates && feels_gyroscopic_torque(slot.inertia), slot.weight + slot.force, {}};
    Vec3& spin = next.now.angular_velocity;
    if (next.turned) spin = turned_freely(next.now.orientation, slot.inertia, spin, h);
    next.loaded = accelerated(slot, next.now, h * next.force, h * slot.torque);
    load(slot, next);
    stepped_[id] = {slot.mass, slot.inertia, next.loaded};
  }
}

std::span<const Contact> ModuleEngine::contacts_with_friction() {
  if (has_friction_ || contacts().empty()) return contacts();
  clock_.start();
  estimate_friction();
  contacts_.take(found_);
  clock_.ends(&EngineTimes::friction_s);
  has_friction_ = true;
  return contacts();
}

void ModuleEngine::estimate_friction() {
  friction_.clear();
  for (const Contact& c : found_) {
    friction_.push_back(std::sqrt(slots_[index(c.a)].material.friction * slots_[index(c.b)].material.friction));
  }
  if (!keeps_frictionless_ && std::ranges::all_of(friction_, [](double mu) { return mu == 0.0; })) {
    for (Contact& c : found_) c.tangential_impulse.setZero();
    return;
  }
  changes_.assign(slots_.size(), {});
  for (const std::uint32_t id : movable_) {
    const Stepped& step = stepped_[id];
    changes_[id] = open_change(step.mass, step.inertia, slots_[id].rotates, step.loaded);
    close(changes_[id], slots_[id].after);
  }
  estimate_.estimate(changes_, friction_, found_);
}

void ModuleEngine::save_rest(std::span<const SavedBody> bodies, std::vector<std::byte>& to) const {
  for (const SavedBody& entry : bodies) {
    const Handles handles{slots_[entry.id].body, slots_[entry.id].shape};
    append(&handles, sizeof handles, to);
  }
  save(memory(), to);
}

void ModuleEngine::restore_rest(std::span<const SavedBody> bodies, std::span<const std::byte> rest) {
  const std::size_t size = bodies.size() * sizeof(Handles);
  if (rest.size() < size) refuse_checkpoint();
  wasm::restore(memory(), rest.subspan(size));
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    Handles handles;
    std::memcpy(&handles, rest.data() + i * sizeof handles, sizeof handles);
    slots_[bodies[i].id].body = handles.body;
    slots_[bodies[i].id].shape = handles.shape;
  }
  handles_changed();
}

/// The state of a movable body is in the module's memory.
void ModuleEngine::restore_body(Slot& slot, const BodyState& state) {
  slot.after = state;
  slot.known = false;
}

}  // namespace subworld::wasm
