#include "physics/wasm/module_engine.hpp"

#include "model/error.hpp"
#include "physics/gyroscope.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

namespace subworld::wasm {

namespace {

constexpr Filter kMovable{1, 1 | 2 | 4 | 8};
constexpr Filter kFixed{2, 1};
constexpr Filter kGhosts{4, 1 | 8};
constexpr Filter kApproaching{8, 1 | 4 | 8};

/// A point is the same one as in the previous sub-step if it is within this distance, relative to the smallest body.
constexpr double kReachRatio = 0.1;

/// A body in a checkpoint, before the module's memory.
using Numbers = Eigen::Matrix<double, 20, 1>;
struct SavedBody {
  std::uint64_t id, body, shape;
  std::array<double, 20> numbers;  ///< mass first
};

[[noreturn]] void refuse_checkpoint() {
  throw Error(ExitCode::failed, "the checkpoint is of another engine or of other bodies; take one from this engine");
}

}  // namespace

ModuleEngine::Slot& ModuleEngine::at(BodyId id) { return const_cast<Slot&>(std::as_const(*this).at(id)); }

const ModuleEngine::Slot& ModuleEngine::at(BodyId id) const {
  if (!contains(id)) throw Error(ExitCode::failed, fmt::format("body {} is not in the engine", index(id)));
  return slots_[index(id)];
}

void ModuleEngine::add(const Body& body, const BodyState& state, Role role) {
  const std::uint32_t id = index(body.id);
  if (contains(body.id)) throw Error(ExitCode::failed, fmt::format("body {} is in the engine already", id));
  if (!finite(state)) throw Error(ExitCode::failed, fmt::format("body {} has a state that is not finite", id));
  if (id >= slots_.size()) slots_.resize(id + 1);
  Slot slot;
  slot.id = id;
  slot.fixed = body.fixed();
  slot.plane = body.shape.kind == ShapeKind::plane;
  slot.rotates = body.rotates;
  slot.friction = body.material.friction;
  slot.mass = body.mass;
  slot.inertia = body.inertia;
  if (body.gravity && !body.fixed()) slot.weight = body.mass * gravity_;
  const Filter& filter = role == Role::ghost         ? kGhosts
                         : role == Role::approaching ? kApproaching
                         : body.fixed()              ? kFixed
                                                     : kMovable;
  create(body.id, slot, body, state, filter);
  set_velocities(slot, state.linear_velocity, state.angular_velocity);
  slots_[id] = slot;
  ++count_;
  contacts_.clear();
  if (body.fixed()) return;
  movable_.push_back(id);
  const Box size = bounds_of(slots_[id]);
  reach_ = std::min(reach_, kReachRatio * (size.upper - size.lower).minCoeff());
}

void ModuleEngine::remove(BodyId id) {
  destroy(at(id));
  at(id) = {};
  --count_;
  std::erase(movable_, index(id));
  contacts_.clear();
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
  constexpr double kEverywhere = 1e18;
  if (slot.plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
  return read_bounds(slot);
}

void ModuleEngine::set_velocities(Slot& slot, const Vec3& linear, const Vec3& angular) {
  if (slot.fixed) {
    slot.after.linear_velocity = linear;
    slot.after.angular_velocity = angular;
  } else {
    put_velocities(slot, linear, angular);
    slot.known = false;
  }
}

bool ModuleEngine::set_state(BodyId id, const BodyState& state) {
  if (!finite(state)) return false;
  Slot& slot = at(id);
  put_pose(slot, state.position, state.orientation);
  set_velocities(slot, state.linear_velocity, state.angular_velocity);
  return true;
}

bool ModuleEngine::set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) {
  if (!linear.allFinite() || !angular.allFinite()) return false;
  set_velocities(at(id), linear, angular);
  return true;
}

void ModuleEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  Slot& slot = at(id);
  slot.mass = mass;
  slot.inertia = inertia;
  put_inertia(slot);
}

namespace {

/// The state after an impulse (N s) and an angular impulse (N m s) about the centre of mass.
template <class Slot>
BodyState accelerated(const Slot& slot, BodyState state, const Vec3& impulse, const Vec3& angular) {
  state.linear_velocity += impulse / slot.mass;
  if (slot.rotates && !angular.isZero(0.0)) state.angular_velocity += spun_up(state.orientation, slot.inertia, angular);
  return state;
}

}  // namespace

bool ModuleEngine::apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) {
  if (!impulse.allFinite() || !point.allFinite()) return false;
  Slot& slot = at(id);
  if (slot.fixed) return true;
  const BodyState now = state_of(slot);
  const BodyState then = accelerated(slot, now, impulse, (point - now.position).cross(impulse));
  set_velocities(slot, then.linear_velocity, then.angular_velocity);
  return true;
}

bool ModuleEngine::apply_force(BodyId id, const Vec3& force, const Vec3& torque) {
  if (!force.allFinite() || !torque.allFinite()) return false;
  Slot& slot = at(id);
  slot.force += force;
  slot.torque += torque;
  return true;
}

double ModuleEngine::integration_substep_s(double dt) const noexcept {
  return dt / substep_count(dt, fixed_substeps_, longest_substep_s_);
}

void ModuleEngine::step(double dt) {
  const int substeps = substep_count(dt, fixed_substeps_, longest_substep_s_);
  const double h = dt / substeps;
  contacts_.clear();
  clock_.start();
  for (int i = 0; i < substeps; ++i) {
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
    // The friction of a step with several sub-steps is their sum, so each is estimated. That of a single sub-step is
    // estimated on request.
    has_friction_ = substeps > 1;
    if (has_friction_) estimate_friction();
    clock_.ends(&EngineTimes::friction_s);
    if (substeps > 1) {
      for (const Contact& c : found_) contacts_.add(c, i, reach_);
    }
  }
  for (const std::uint32_t id : movable_) slots_[id].force = slots_[id].torque = Vec3::Zero();
  if (substeps > 1) {
    contacts_.merge();
  } else {
    contacts_.take(found_);
  }
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
    friction_.push_back(std::sqrt(slots_[index(c.a)].friction * slots_[index(c.b)].friction));
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

void ModuleEngine::overlap(const Box& box, std::vector<BodyId>& out) const {
  out.clear();
  for (std::uint32_t id = 0; id < slots_.size(); ++id) {
    if (slots_[id].body != 0 && bounds_of(slots_[id]).meets(box)) out.push_back(BodyId{id});
  }
}

Checkpoint ModuleEngine::checkpoint() const {
  Checkpoint saved;
  append(&count_, sizeof count_, saved.bytes);
  for (std::uint32_t id = 0; id < slots_.size(); ++id) {
    const Slot& slot = slots_[id];
    if (slot.body == 0) continue;
    SavedBody entry{id, slot.body, slot.shape, {}};
    Eigen::Map<Numbers>(entry.numbers.data()) << (slot.fixed ? 0.0 : slot.mass), slot.inertia, slot.weight, slot.force,
        slot.torque, slot.friction, slot.after.linear_velocity, slot.after.angular_velocity;
    append(&entry, sizeof entry, saved.bytes);
  }
  save(memory(), saved.bytes);
  return saved;
}

void ModuleEngine::restore(const Checkpoint& saved) {
  std::uint64_t count = 0;
  if (saved.bytes.size() > sizeof count) std::memcpy(&count, saved.bytes.data(), sizeof count);
  if (count != count_ || saved.bytes.size() < sizeof count + count * sizeof(SavedBody)) refuse_checkpoint();
  std::vector<SavedBody> entries(count);
  std::memcpy(entries.data(), saved.bytes.data() + sizeof count, count * sizeof(SavedBody));
  for (const SavedBody& entry : entries) {
    const bool fixed = entry.numbers[0] == 0.0;
    if (entry.id >= slots_.size() || slots_[entry.id].body == 0 || slots_[entry.id].fixed != fixed) refuse_checkpoint();
  }
  wasm::restore(memory(), std::span(saved.bytes).subspan(sizeof count + count * sizeof(SavedBody)));
  for (const SavedBody& entry : entries) {
    const Eigen::Map<const Numbers> x(entry.numbers.data());
    Slot& slot = slots_[entry.id];
    slot.body = entry.body;
    slot.shape = entry.shape;
    slot.mass = x[0];
    slot.inertia = x.segment<3>(1);
    slot.weight = x.segment<3>(4);
    slot.force = x.segment<3>(7);
    slot.torque = x.segment<3>(10);
    slot.friction = x[13];
    slot.after.linear_velocity = x.segment<3>(14);
    slot.after.angular_velocity = x.segment<3>(17);
    slot.known = false;
  }
  restored();
  contacts_.clear();
}

}  // namespace subworld::wasm
