#include "coupling/schemes/reduced/ghosts.hpp"

#include "coupling/sync/blend.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

constexpr double kImpact_m_s2 = 5.0;  ///< copies whose speeds change so differently: one has met an impact, one not yet
/// What a wall may have to carry beyond its load in the world, which is a cycle old or more: so many times what the
/// operators press with now, wedges included, and so many times the weight of its body, for what topples.
constexpr double kSpareForces = 2.0;
constexpr double kSpareWeights = 4.0;
constexpr double kSpinInertia = 1000.0;  ///< times the body's own: a ghost turns as the world's body does

const BodyState* state_in(const WorldFrame& frame, BodyId id) noexcept {
  const auto at = find_sorted(frame.states, id, &StampedBody::id);
  return at != frame.states.end() ? &at->state : nullptr;
}

Role role_of(const GhostModel& model) noexcept { return model.approaching ? Role::approaching : Role::ghost; }

}  // namespace

bool ghosts_fit(const WorldFrame& frame, const Scene& scene) noexcept {
  const auto in_scene = [&](BodyId id) { return index(id) < scene.bodies.size(); };
  const auto possible = [&](const GhostModel& ghost) {
    if (!in_scene(ghost.outside)) return false;
    const Body& body = scene.body(ghost.outside);
    return !body.fixed() && (!ghost.carried || holds(*ghost.carried, body));
  };
  return std::ranges::all_of(frame.ghosts, possible) &&
         std::ranges::all_of(frame.ghost_peers, in_scene, &GhostPeer::proxy);
}

Ghosts::Ghosts(const Scene& scene, std::uint64_t remembered_cycles) : scene_(scene), remembered_(remembered_cycles) {
  ghosts_.reserve(kUsualMembers);
  spare_logs_.assign(kUsualMembers, std::vector<Logged>(remembered_));
}

std::vector<Ghosts::Logged> Ghosts::empty_log() {
  if (spare_logs_.empty()) return std::vector<Logged>(remembered_);
  std::vector<Logged> log = std::move(spare_logs_.back());
  spare_logs_.pop_back();
  std::ranges::fill(log, Logged{});
  return log;
}

std::vector<Ghosts::Ghost>::iterator Ghosts::drop(std::vector<Ghost>::iterator ghost, Engine& engine) {
  engine.remove(ghost->id);
  gradual_.forget(ghost->id);
  spare_logs_.push_back(std::move(ghost->log));
  return ghosts_.erase(ghost);
}

void Ghosts::follow(const WorldFrame& frame, Engine& engine, const Following& how) {
  peers_ = frame.ghost_peers;
  for (auto ghost = ghosts_.begin(); ghost != ghosts_.end();) {
    const auto model = find_sorted(frame.ghosts, ghost->id, &GhostModel::outside);
    const bool gone = model == frame.ghosts.end();
    // What was carried and is held now begins anew: it collided with nothing that is fixed, and may have passed
    // through.
    ghost = gone || (ghost->carried && !model->carried) ? drop(ghost, engine) : std::next(ghost);
  }
  for (const GhostModel& model : frame.ghosts) {
    const BodyState* world = state_in(frame, model.outside);
    if (world == nullptr) continue;
    const auto at = find_sorted(ghosts_, model.outside, &Ghost::id);
    if (at == ghosts_.end()) {
      create(model, *world, frame, engine, how.lag_s);
      continue;
    }
    adapt(*at, model, engine);
    correct(*at, *world, frame, engine, how);
  }
}

Body Ghosts::as_ghost(const GhostModel& model) const {
  Body body = nameless(scene_.body(model.outside));
  body.gravity = false;
  if (model.carried) return body;
  body.mass = model.mass_kg;
  body.inertia *= kSpinInertia;
  return body;
}

void Ghosts::adapt(Ghost& ghost, const GhostModel& model, Engine& engine) {
  const Body& body = scene_.body(ghost.id);
  GhostMotion& motion = ghost.motion;
  if (motion.model.approaching != model.approaching) {
    const BodyState now = engine.state(ghost.id);
    const Body renewed = as_ghost(model);
    engine.remove(ghost.id);
    engine.add(renewed, now, role_of(model));
    ghost.mass_kg = renewed.mass;
  }
  if (model.carried) {
    if (!ghost.carried) {
      const BodyState now = engine.state(ghost.id);
      ghost.carried.emplace();
      ghost.carried->velocity << now.linear_velocity, now.angular_velocity;
      engine.set_inertia(ghost.id, body.mass, body.inertia);
    }
    ghost.carried->follow(*model.carried);
  }
  motion.model = model;
}

BodyState Ghosts::start_of(const GhostModel& model, const BodyState& world, const WorldFrame& frame,
                           const Engine& engine, double lag_s) const {
  BodyState start = advanced(world, lag_s);
  // What it touches has moved on, and as the sub-world says, not the world: nothing may begin inside something.
  const Vec3 moved = start.position - world.position;
  const auto offset_of = [&](BodyId inside) -> Vec3 {
    const BodyState* theirs = state_in(frame, inside);
    if (theirs == nullptr || !engine.contains(inside)) return Vec3::Zero();
    return engine.state(inside).position - theirs->position - moved;
  };
  start.position += clearance(model, frame.border, std::cref(offset_of));
  return start;
}

BodyState Ghosts::constrained(const GhostMotion& motion, const BodyState& own, const BodyState& world, double lag_s) {
  const BodyState later = advanced(world, lag_s);
  return {.position = later.position + motion.along(own.position - later.position),
          .orientation = later.orientation,
          .linear_velocity = world.linear_velocity + motion.along(own.linear_velocity - world.linear_velocity),
          .angular_velocity = world.angular_velocity};
}

void Ghosts::create(const GhostModel& model, const BodyState& world, const WorldFrame& frame, Engine& engine,
                    double lag_s) {
  if (engine.contains(model.outside)) return;
  const Body body = as_ghost(model);
  engine.add(body, start_of(model, world, frame, engine, lag_s), role_of(model));
  Ghost ghost{.id = body.id,
              .motion = {.model = model, .world_velocity = world.linear_velocity},
              .world_stamp = frame.stamp,
              .spin = world.angular_velocity,
              .mass_kg = body.mass,
              .log = empty_log()};
  adapt(ghost, model, engine);
  ghosts_.insert(std::ranges::lower_bound(ghosts_, body.id, {}, &Ghost::id), std::move(ghost));
}

bool Ghosts::impact_is_due(const Ghost& ghost, const BodyState& world, const WorldFrame& frame) const {
  const Logged& now = ghost.log[frame.stamp % remembered_];
  const Logged& before = ghost.log[ghost.world_stamp % remembered_];
  if (!before.written || before.stamp != ghost.world_stamp) return false;
  const Vec3 ours = now.state.linear_velocity - before.state.linear_velocity;
  const Vec3 theirs = world.linear_velocity - ghost.motion.world_velocity;
  const double passed_s = static_cast<double>(frame.stamp - ghost.world_stamp) * frame.cycle_s;
  return ghost.motion.along(theirs - ours).norm() > kImpact_m_s2 * passed_s;
}

void Ghosts::correct(Ghost& ghost, const BodyState& world, const WorldFrame& frame, Engine& engine,
                     const Following& how) {
  const GhostMotion& motion = ghost.motion;
  Shift shift;
  const Logged& then = ghost.log[frame.stamp % remembered_];
  if (then.written && then.stamp == frame.stamp) {
    if (ghost.carried) {
      shift = scaled(difference(then.state, world), how.gain);
      ghost.carried->velocity.head<3>() += shift.linear_velocity;
      ghost.carried->velocity.tail<3>() += shift.angular_velocity;
    } else {
      shift.position = motion.along(how.gain * (world.position - then.state.position));
      if (!impact_is_due(ghost, world, frame))
        shift.linear_velocity = motion.along(world.linear_velocity - then.state.linear_velocity);
    }
    for (std::uint64_t stamp = frame.stamp; stamp <= logged_; ++stamp) {
      Logged& entry = ghost.log[stamp % remembered_];
      if (entry.written && entry.stamp == stamp) entry.state = shifted(entry.state, shift);
    }
  }
  ghost.motion.world_velocity = world.linear_velocity;
  ghost.world_stamp = frame.stamp;
  ghost.spin = world.angular_velocity;
  const BodyState now = engine.state(ghost.id);
  gradual_.begin(engine, ghost.id, ghost.carried ? now : constrained(motion, now, world, how.lag_s), shift,
                 how.substeps);
}

std::optional<BodyState> Ghosts::release(BodyId id, Engine& engine) {
  const auto at = find_sorted(ghosts_, id, &Ghost::id);
  if (at == ghosts_.end()) return std::nullopt;
  const BodyState state = engine.state(id);
  drop(at, engine);
  return state;
}

void Ghosts::clear(Engine& engine) {
  while (!ghosts_.empty()) drop(ghosts_.end() - 1, engine);
}

void Ghosts::attach(Ghost& ghost, const BodyState& now, double dt, std::span<const PeerPull> peers) const {
  ghost.motion.springs = {};
  for (const GhostPeer& behind : peers_) {
    const auto peer = std::ranges::find(peers, behind.proxy, &PeerPull::proxy);
    if (behind.outside != ghost.id || behind.axis >= ghost.motion.model.axis_count || peer == peers.end()) continue;
    const Vec3& normal = ghost.motion.model.axes[behind.axis].normal;
    const AxisSpring pushes =
        push_of(*peer, normal, normal.dot(now.position) + behind.offset_m, normal.dot(now.linear_velocity), dt);
    AxisSpring& spring = ghost.motion.springs[behind.axis];
    spring.force_n += pushes.force_n;
    spring.added_kg += pushes.added_kg;
  }
}

void Ghosts::begin(Engine& engine, double dt, double operators_n, std::span<const PeerPull> peers) {
  gradual_.step(engine);
  const double gravity_m_s2 = scene_.settings.world.gravity.norm();
  for (Ghost& ghost : ghosts_) {
    const BodyState now = engine.state(ghost.id);
    if (ghost.carried) {
      ghost.start = ghost.carried->begin(scene_.body(ghost.id), now.orientation, dt);
    } else {
      const Body& body = scene_.body(ghost.id);
      attach(ghost, now, dt, peers);
      if (ghost.motion.mass_kg() != ghost.mass_kg) {
        ghost.mass_kg = ghost.motion.mass_kg();
        engine.set_inertia(ghost.id, ghost.mass_kg, kSpinInertia * body.inertia);
      }
      const double spare_n = kSpareForces * operators_n + kSpareWeights * gravity_m_s2 * body.mass;
      ghost.start << ghost.motion.begin(now.linear_velocity, dt, spare_n), ghost.spin;
      engine.apply_force(ghost.id, ghost.motion.force(), Vec3::Zero());
    }
    engine.set_velocity(ghost.id, ghost.start.head<3>(), ghost.start.tail<3>());
  }
}

void Ghosts::end(const Engine& engine, double dt) {
  for (Ghost& ghost : ghosts_) {
    const BodyState now = engine.state(ghost.id);
    if (ghost.carried) {
      Vec6 after;
      after << now.linear_velocity, now.angular_velocity;
      ghost.carried->end(scene_.body(ghost.id), now.orientation, ghost.start, after, dt);
    } else {
      ghost.motion.end(ghost.start.head<3>(), now.linear_velocity, dt);
    }
  }
}

void Ghosts::log(std::uint64_t stamp, const Engine& engine) {
  logged_ = stamp;
  for (Ghost& ghost : ghosts_) {
    BodyState state = gradual_.completed(ghost.id, engine.state(ghost.id));
    if (ghost.carried) {
      state.linear_velocity = ghost.carried->velocity.head<3>();
      state.angular_velocity = ghost.carried->velocity.tail<3>();
    }
    ghost.log[stamp % remembered_] = {stamp, true, state};
  }
}

}  // namespace subworld
