#include "physics/shells/live_engine.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

/// Steps of a warm-up: with moving bodies, so that all contacts are found; then with fixed ones, so that the solver's
/// first guess converges.
constexpr int kFreeSteps = 10, kStandingSteps = 10;

void put(Engine& engine, const HeldBody& held) {
  engine.add(held.body, held.state, held.role);
  if (!held.body.fixed()) engine.set_inertia(held.body.id, held.mass, held.inertia);
}

void warm_up(PreparedEngine& prepared, double dt) {
  Engine& engine = *prepared.engine;
  for (int i = 0; i < kFreeSteps + kStandingSteps; ++i) {
    for (const HeldBody& held : prepared.holds) {
      if (!held.body.fixed()) engine.apply_force(held.body.id, held.load.force, held.load.torque);
    }
    engine.step(dt);
    if (i + 1 < kFreeSteps) continue;
    for (const HeldBody& held : prepared.holds) engine.set_state(held.body.id, held.state);
  }
}

}  // namespace

PreparedEngine prepare_engine(const EngineSettings& settings, std::span<const Mesh> meshes,
                              std::vector<HeldBody> content, double warm_up_s, std::span<const Joint> joints) {
  PreparedEngine prepared{make_engine(settings, meshes), std::move(content)};
  prepared.engine->set_joints(joints);
  for (const HeldBody& held : prepared.holds) put(*prepared.engine, held);
  if (warm_up_s > 0.0) warm_up(prepared, warm_up_s);
  return prepared;
}

void LiveEngine::add(const Body& body, const BodyState& state, Role role) {
  engine_->add(body, state, role);
  if (index(body.id) >= held_.size()) held_.resize(index(body.id) + 1);
  held_[index(body.id)] = {nameless(body), role, body.mass, body.inertia, {}, {}, 0, ++added_};
}

void LiveEngine::break_joint(std::size_t joint) {
  engine_->break_joint(joint);
  broken_.push_back(joint);
}

void LiveEngine::remove(BodyId id) {
  engine_->remove(id);
  held_[index(id)].reset();
}

void LiveEngine::remove_all(std::span<const BodyId> ids) {
  engine_->remove_all(ids);
  for (const BodyId id : ids) held_[index(id)].reset();
}

void LiveEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  engine_->set_inertia(id, mass, inertia);
  held_[index(id)]->mass = mass;
  held_[index(id)]->inertia = inertia;
}

bool LiveEngine::apply_force(BodyId id, const Vec3& force, const Vec3& torque) {
  if (!engine_->apply_force(id, force, torque)) return false;
  HeldBody& held = *held_[index(id)];
  if (held.loaded != steps_) held.load = {};
  held.loaded = steps_;
  held.load.force += force;
  held.load.torque += torque;
  return true;
}

void LiveEngine::step_driven(double dt, std::span<const BodyId> driven, const StepDrive& drive) {
  const StepDrive part = [&](double until_s, double h) {
    ++steps_;  // loads are those of the last part
    drive(until_s, h);
  };
  EngineShell::step_driven(dt, driven, part);
}

std::vector<HeldBody> LiveEngine::content() const {
  std::vector<HeldBody> content;
  for (const auto& held : held_) {
    if (!held) continue;
    content.push_back(*held);
    content.back().state = engine_->state(held->body.id);
    if (held->loaded + 1 != steps_) content.back().load = {};
  }
  return content;
}

std::unique_ptr<Engine> LiveEngine::exchange(PreparedEngine prepared) {
  Engine& next = *prepared.engine;
  for (const std::size_t joint : broken_) next.break_joint(joint);
  const auto still_here = [&](const HeldBody& then) {
    const std::size_t id = index(then.body.id);
    return id < held_.size() && held_[id] && held_[id]->added == then.added;
  };
  for (const HeldBody& then : prepared.holds) {
    if (!still_here(then)) next.remove(then.body.id);
  }
  for (auto& held : held_) {
    if (!held) continue;
    const BodyId id = held->body.id;
    held->state = engine_->state(id);
    if (!next.contains(id)) {
      put(next, *held);
      continue;
    }
    next.set_state(id, held->state);
    if (!held->body.fixed()) next.set_inertia(id, held->mass, held->inertia);
  }
  return std::exchange(engine_, std::move(prepared.engine));
}

}  // namespace subworld
