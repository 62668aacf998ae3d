#include "physics/live_engine.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

constexpr int kWarmUpSteps = 3;

/// Engines do not look at names; leaving them out spares an allocation.
Body nameless(const Body& body) {
  Body copy;
  copy.id = body.id;
  copy.shape = body.shape;
  copy.material = body.material;
  copy.mass = body.mass;
  copy.inertia = body.inertia;
  copy.gravity = body.gravity;
  copy.rotates = body.rotates;
  return copy;
}

void put(Engine& engine, const HeldBody& held) {
  engine.add(held.body, held.state, held.role);
  if (!held.body.fixed()) engine.set_inertia(held.body.id, held.mass, held.inertia);
}

}  // namespace

PreparedEngine prepare_engine(const EngineSettings& settings, std::span<const Mesh> meshes,
                              std::vector<HeldBody> content, double warm_up_s) {
  PreparedEngine prepared{make_engine(settings, meshes), std::move(content)};
  for (const HeldBody& held : prepared.holds) put(*prepared.engine, held);
  for (int i = 0; warm_up_s > 0.0 && i < kWarmUpSteps; ++i) {
    prepared.engine->step(warm_up_s);
    for (const HeldBody& held : prepared.holds) prepared.engine->set_state(held.body.id, held.state);
  }
  return prepared;
}

void LiveEngine::add(const Body& body, const BodyState& state, Role role) {
  engine_->add(body, state, role);
  if (index(body.id) >= held_.size()) held_.resize(index(body.id) + 1);
  held_[index(body.id)] = {nameless(body), role, body.mass, body.inertia, {}, ++added_};
}

void LiveEngine::remove(BodyId id) {
  engine_->remove(id);
  held_[index(id)].reset();
}

void LiveEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  engine_->set_inertia(id, mass, inertia);
  held_[index(id)]->mass = mass;
  held_[index(id)]->inertia = inertia;
}

std::vector<HeldBody> LiveEngine::content() const {
  std::vector<HeldBody> content;
  for (const auto& held : held_) {
    if (!held) continue;
    content.push_back(*held);
    content.back().state = engine_->state(held->body.id);
  }
  return content;
}

std::unique_ptr<Engine> LiveEngine::exchange(PreparedEngine prepared) {
  Engine& next = *prepared.engine;
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
