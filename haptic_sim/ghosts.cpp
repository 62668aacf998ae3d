#include "haptic_sim/ghosts.hpp"

#include "coupling/blend.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr double kVelocityGain = 0.8;    ///< of the error along the normal
constexpr double kSpinInertia = 1000.0;  ///< times the body's own: a ghost turns as the world's body does

const BodyState* state_in(const WorldFrame& frame, BodyId id) noexcept {
  const auto at = std::ranges::lower_bound(frame.states, id, {}, &StampedBody::id);
  return at != frame.states.end() && at->id == id ? &at->state : nullptr;
}

}  // namespace

Ghosts::Ghosts(const Scene& scene, std::uint64_t remembered_cycles) : scene_(scene), remembered_(remembered_cycles) {
  ghosts_.reserve(kUsualMembers);
}

void Ghosts::follow(const WorldFrame& frame, Engine& engine, double lag_s, double gain) {
  std::erase_if(ghosts_, [&](const Ghost& ghost) {
    const bool gone = !std::ranges::binary_search(frame.ghosts, ghost.id, {}, &GhostModel::outside);
    if (gone) engine.remove(ghost.id);
    return gone;
  });
  for (const GhostModel& model : frame.ghosts) {
    const BodyState* world = state_in(frame, model.outside);
    if (world == nullptr) continue;
    const auto at = std::ranges::lower_bound(ghosts_, model.outside, {}, &Ghost::id);
    if (at == ghosts_.end() || at->id != model.outside) {
      create(model, *world, frame, engine, lag_s);
      continue;
    }
    if (at->motion.model.mass_kg != model.mass_kg) {
      engine.set_inertia(at->id, model.mass_kg, kSpinInertia * scene_.body(at->id).inertia);
    }
    at->motion.model = model;
    correct(*at, *world, frame, engine, lag_s, gain);
  }
}

void Ghosts::create(const GhostModel& model, const BodyState& world, const WorldFrame& frame, Engine& engine,
                    double lag_s) {
  Body body = scene_.body(model.outside);
  if (engine.contains(body.id)) return;
  body.gravity = false;
  body.mass = model.mass_kg;
  body.inertia *= kSpinInertia;
  BodyState start = advanced(world, lag_s);
  // Members are where the sub-world has them, not where the world does: nothing may begin inside something.
  const auto offset_of = [&](BodyId inside) -> Vec3 {
    const BodyState* theirs = state_in(frame, inside);
    if (theirs == nullptr || !engine.contains(inside)) return Vec3::Zero();
    return engine.state(inside).position - advanced(*theirs, lag_s).position;
  };
  start.position += clearance(model, frame.border, offset_of);
  engine.add(body, start, Role::ghost);

  Ghost ghost{.id = body.id,
              .motion = {.model = model, .world_velocity = world.linear_velocity},
              .spin = world.angular_velocity,
              .log = {}};
  ghost.motion.load_n = model.load_n;
  ghost.log.resize(remembered_);
  ghosts_.insert(std::ranges::lower_bound(ghosts_, body.id, {}, &Ghost::id), std::move(ghost));
}

void Ghosts::correct(Ghost& ghost, const BodyState& world, const WorldFrame& frame, Engine& engine, double lag_s,
                     double gain) {
  const GhostMotion& motion = ghost.motion;
  const BodyState later = advanced(world, lag_s);
  BodyState now = engine.state(ghost.id);
  const Logged& then = ghost.log[frame.stamp % remembered_];
  if (then.written && then.stamp == frame.stamp) {
    const Vec3 shift = gain * motion.along(world.position - then.position);
    const Vec3 speed_up = kVelocityGain * motion.along(world.linear_velocity - then.velocity);
    now.position += shift;
    now.linear_velocity += speed_up;
    for (Logged& entry : ghost.log) {
      if (!entry.written || entry.stamp <= frame.stamp) continue;
      entry.position += shift;
      entry.velocity += speed_up;
    }
  }
  ghost.motion.world_velocity = world.linear_velocity;
  ghost.spin = world.angular_velocity;
  now.position = later.position + motion.along(now.position - later.position);
  now.linear_velocity = world.linear_velocity + motion.along(now.linear_velocity - world.linear_velocity);
  now.orientation = later.orientation;
  now.angular_velocity = ghost.spin;
  engine.set_state(ghost.id, now);
}

std::optional<BodyState> Ghosts::release(BodyId id, Engine& engine) {
  const auto at = std::ranges::lower_bound(ghosts_, id, {}, &Ghost::id);
  if (at == ghosts_.end() || at->id != id) return std::nullopt;
  const BodyState state = engine.state(id);
  engine.remove(id);
  ghosts_.erase(at);
  return state;
}

void Ghosts::clear(Engine& engine) {
  for (const Ghost& ghost : ghosts_) engine.remove(ghost.id);
  ghosts_.clear();
}

void Ghosts::begin(Engine& engine, double dt) {
  for (Ghost& ghost : ghosts_) {
    ghost.start = ghost.motion.begin(engine.state(ghost.id).linear_velocity, dt);
    engine.set_velocity(ghost.id, ghost.start, ghost.spin);
    engine.apply_force(ghost.id, ghost.motion.force(), Vec3::Zero());
  }
}

void Ghosts::end(const Engine& engine, double dt) {
  for (Ghost& ghost : ghosts_) ghost.motion.end(ghost.start, engine.state(ghost.id).linear_velocity, dt);
}

void Ghosts::log(std::uint64_t stamp, const Engine& engine) {
  for (Ghost& ghost : ghosts_) {
    const BodyState state = engine.state(ghost.id);
    ghost.log[stamp % remembered_] = {stamp, true, state.position, state.linear_velocity};
  }
}

}  // namespace subworld
