#include "physics/resting_engine.hpp"

#include "model/error.hpp"
#include "model/reach.hpp"
#include "model/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kLookEvery_s = 0.05;   ///< for who may sleep, and who settles
constexpr double kLeastFriction = 0.1;  ///< of what settles: it brakes what slides more than the damping does

bool rolls(const Shape& shape) noexcept {
  return shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder;
}

double gap_m(const Box& a, const Box& b) noexcept {
  return (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0).norm();
}

}  // namespace

RestingEngine::RestingEngine(Engine& inner, const Scene& scene, std::span<const BodyId> restless, bool rests,
                             bool settles)
    : inner_(inner),
      scene_(scene),
      rests_(rests),
      settles_(rests && settles),
      gravity_m_s2_(scene.settings.world.gravity.norm()),
      things_(scene.bodies.size()),
      still_(rests ? scene.bodies.size() : 0) {
  for (const BodyId id : restless) things_[index(id)].restless = true;
  for (std::vector<BodyId>* list : {&awake_, &waking_, &woke_, &slept_}) list->reserve(scene.bodies.size());
  frontier_.reserve(scene.bodies.size() + 1);
  reached_.reserve(scene.bodies.size());
  near_hands_.reserve(scene.bodies.size());
}

void RestingEngine::add(const Body& body, const BodyState& state, Role role) {
  Thing& thing = things_[index(body.id)];
  const bool sleeps = rests_ && body.at_rest && !thing.restless;
  if (!sleeps) inner_.add(body, state, role);
  if (body.fixed()) return;
  thing.anchor = state;
  thing.still_s = 0.0;
  thing.parent = thing.next = index(body.id);
  const Box box = subworld::bounds(body.shape, {}, scene_.meshes);
  thing.arm_m = box.lower.cwiseAbs().cwiseMax(box.upper.cwiseAbs()).norm();
  thing.thickness_m = thickness(body.shape, scene_.meshes);
  thing.drift_m = thing.tolerance_m = kDrift * thing.thickness_m;
  const bool may_settle = settles_ && !thing.restless && body.gravity && !rolls(body.shape);
  thing.calm_m_s = may_settle ? std::sqrt(2.0 * gravity_m_s2_ * kLift * thing.thickness_m) : 0.0;
  thing.calm_s = 0.0;
  if (sleeps) {
    lay_asleep(index(body.id));
  } else {
    awake_.insert(std::ranges::lower_bound(awake_, body.id), body.id);
  }
}

void RestingEngine::lay_asleep(std::uint32_t one) {
  Thing& thing = things_[one];
  thing.bounds = subworld::bounds(scene_.bodies[one].shape, thing.anchor, scene_.meshes);
  thing.asleep = true;
  thing.still_s = thing.unreached_s = kStillFor_s;
  const Box box = thing.bounds.grown(thing.drift_m);
  still_.find(box, [&](std::uint32_t other) {
    if (things_[other].asleep) join(one, other);
  });
  still_.insert(one, box);
  ++asleep_count_;
}

void RestingEngine::remove(BodyId id) {
  wake_before(id);
  inner_.remove(id);
  if (rests_ && still_.contains(index(id))) still_.remove(index(id));
  std::erase(awake_, id);
  std::erase(waking_, id);
}

Capabilities RestingEngine::capabilities() const noexcept {
  Capabilities can = inner_.capabilities();
  can.checkpoint = Fidelity::absent;
  return can;
}

Checkpoint RestingEngine::checkpoint() const {
  throw Error(ExitCode::failed, "an engine in which bodies sleep has no checkpoints; take those of its inner engine");
}

void RestingEngine::restore(const Checkpoint&) { (void)checkpoint(); }

bool RestingEngine::set_state(BodyId id, const BodyState& state) {
  wake_before(id);
  return inner_.set_state(id, state);
}

bool RestingEngine::set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) {
  wake_before(id);
  return inner_.set_velocity(id, linear, angular);
}

void RestingEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  wake_before(id);
  inner_.set_inertia(id, mass, inertia);
}

bool RestingEngine::apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) {
  wake_before(id);
  return inner_.apply_impulse(id, impulse, point);
}

bool RestingEngine::apply_force(BodyId id, const Vec3& force, const Vec3& torque) {
  wake_before(id);
  return inner_.apply_force(id, force, torque);
}

bool RestingEngine::negligible(BodyId id, const BodyState& to) const {
  const Thing& thing = things_[index(id)];
  return thing.moved_m(thing.anchor, to) <= thing.drift_m;
}

double RestingEngine::Thing::moved_m(const BodyState& from, const BodyState& to) const {
  return (to.position - from.position).norm() + arm_m * to.orientation.angularDistance(from.orientation);
}

void RestingEngine::asleep_in(const Box& box, std::vector<BodyId>& out) const {
  out.clear();
  if (!rests_) return;
  still_.find(box, [&](std::uint32_t item) {
    if (things_[item].asleep) out.push_back(BodyId{item});
  });
}

void RestingEngine::step(double dt) {
  inner_.step(dt);
  if (!rests_) return;
  since_look_s_ += dt;
  if (since_look_s_ < kLookEvery_s) return;
  since_look_s_ = 0.0;
  find_islands();  // while the contacts are there
}

void RestingEngine::follow(double dt, double horizon_s) {
  slept_.clear();
  woke_.clear();
  if (!rests_) return;
  for (const BodyId id : awake_) watch(id, dt);
  reached_.clear();
  for (const BodyId id : awake_) {
    if (!still_.contains(index(id))) reach_from(id, horizon_s);
  }
  for (const std::uint32_t i : reached_) {
    things_[i].reached = false;
    things_[i].unreached_s = 0.0;
  }
  std::swap(woke_, waking_);
  if (!woke_.empty()) {
    awake_.insert(awake_.end(), woke_.begin(), woke_.end());
    std::ranges::sort(awake_);
  }
  if (std::exchange(islands_known_, false)) {
    find_settling(horizon_s);
    put_to_sleep();
  }
  settle(dt);
}

void RestingEngine::watch(BodyId id, double dt) {
  Thing& thing = things_[index(id)];
  const BodyState now = inner_.state(id);
  const double speed_m_s = now.linear_velocity.norm() + thing.arm_m * now.angular_velocity.norm();
  thing.calm_s = speed_m_s < thing.calm_m_s ? thing.calm_s + dt : 0.0;
  if (thing.settles) {
    thing.settled_s += dt;
    if (thing.moved_m(thing.place, now) > kSettlingPlace * thing.thickness_m) {
      thing.settles = false;
      thing.calm_s = 0.0;
      thing.unsettle();
      thing.patience_s *= 2.0;
    }
  }
  if (thing.moved_m(thing.anchor, now) > thing.tolerance_m) {
    thing.anchor = now;
    thing.tolerance_m = thing.settled_s < kSettledFor_s ? thing.drift_m : kTremble * thing.thickness_m;
    thing.still_s = thing.unreached_s = 0.0;
    if (still_.contains(index(id))) still_.remove(index(id));
    return;
  }
  thing.still_s += dt;
  thing.unreached_s += dt;
  if (thing.restless || thing.still_s < kStillFor_s || still_.contains(index(id))) return;
  thing.bounds = inner_.bounds(id);
  still_.insert(index(id), thing.bounds.grown(2.0 * thing.tolerance_m));  // from one side of the anchor to the other
}

void RestingEngine::reach_from(BodyId mover, double horizon_s) {
  const Thing& thing = things_[index(mover)];
  const BodyState now = inner_.state(mover);
  const double acceleration_m_s2 = thing.restless ? kHand_m_s2 : gravity_m_s2_;  // others fall, or are pushed
  const double travel_m = reach_m(now, thing.arm_m, acceleration_m_s2, horizon_s) + thing.drift_m;
  frontier_.assign(1, {inner_.bounds(mover), travel_m});
  double hit = kHit;  // of what the mover itself hits; from there on, all is counted as so fast already
  while (!frontier_.empty()) {
    const Reach reach = frontier_.back();
    frontier_.pop_back();
    const std::size_t first = reached_.size();
    still_.find(reach.from.grown(reach.travel_m), [&](std::uint32_t item) {
      Thing& other = things_[item];
      const double left_m = reach.travel_m - gap_m(reach.from, still_.box(item));
      if (other.reached || left_m < 0.0) return;
      other.reached = true;
      reached_.push_back(item);
      frontier_.push_back({still_.box(item), hit * left_m});
    });
    hit = 1.0;
    for (std::size_t i = first; i < reached_.size(); ++i) {
      if (things_[reached_[i]].asleep) wake(reached_[i]);
    }
  }
}

void RestingEngine::wake(std::uint32_t one) {
  // In the order of their ids, so that equal runs stay equal.
  const std::size_t first = waking_.size();
  std::uint32_t i = one;
  do {
    waking_.push_back(BodyId{i});
    i = things_[i].next;
  } while (i != one);
  std::ranges::sort(waking_.begin() + static_cast<std::ptrdiff_t>(first), waking_.end());
  for (std::size_t k = first; k < waking_.size(); ++k) {
    const BodyId id = waking_[k];
    Thing& thing = things_[index(id)];
    thing.asleep = false;
    thing.unreached_s = 0.0;
    thing.settles = false;
    thing.parent = thing.next = index(id);
    inner_.add(scene_.body(id), thing.anchor, Role::body);
    --asleep_count_;
  }
}

void RestingEngine::wake_all() {
  for (std::uint32_t i = 0; i < things_.size(); ++i) {
    if (things_[i].asleep) wake(i);
  }
}

std::uint32_t RestingEngine::root(std::uint32_t i) noexcept {
  while (things_[i].parent != i) i = things_[i].parent = things_[things_[i].parent].parent;
  return i;
}

bool RestingEngine::may_sleep(std::uint32_t i) const {
  return still_.contains(i) && things_[i].unreached_s >= kStillFor_s;
}

void RestingEngine::find_islands() {
  for (const BodyId id : awake_) {
    Thing& thing = things_[index(id)];
    thing.parent = thing.next = index(id);
    thing.slips = false;
  }
  for (const Contact& c : inner_.contacts()) {
    const Body &a = scene_.body(c.a), &b = scene_.body(c.b);
    if (!a.fixed() && !b.fixed()) join(index(c.a), index(c.b));
    const bool rubs = a.material.friction * b.material.friction >= kLeastFriction * kLeastFriction;
    for (const BodyId id : {c.a, c.b}) things_[index(id)].slips |= !rubs;
  }
  islands_known_ = true;
}

void RestingEngine::find_settling(double horizon_s) {
  if (!settles_) return;
  for (const BodyId id : awake_) {
    things_[root(index(id))].settles = true;
    things_[root(index(id))].in_hand = things_[root(index(id))].sways = false;
  }
  const auto is_calm = [](const Thing& thing) { return thing.calm_s >= thing.patience_s && !thing.slips; };
  for (const BodyId id : awake_) {
    const Thing& thing = things_[index(id)];
    if (!still_.contains(index(id))) things_[root(index(id))].sways = true;
    if (!is_calm(thing)) things_[root(index(id))].settles = false;
    if (!thing.restless) continue;
    const double travel_m = reach_m(inner_.state(id), thing.arm_m, kHand_m_s2, kLookEvery_s + horizon_s);
    inner_.overlap(inner_.bounds(id).grown(travel_m), near_hands_);
    for (const BodyId near : near_hands_) {
      if (!scene_.body(near).fixed()) things_[root(index(near))].in_hand = true;
    }
  }
  for (const BodyId id : awake_) {
    Thing& thing = things_[index(id)];
    const Thing& all = things_[root(index(id))];
    if (all.in_hand || !is_calm(thing)) thing.unsettle();
    thing.settles = all.settles && !all.in_hand;
    thing.sways = all.sways;
    if (thing.settled_s == 0.0) thing.place = inner_.state(id);
  }
}

void RestingEngine::settle(double dt) {
  if (!settles_) return;
  const double left = std::exp(-kSettling_per_s * dt);
  for (const BodyId id : awake_) {
    if (!things_[index(id)].settles || !things_[index(id)].sways) continue;
    const BodyState now = inner_.state(id);
    inner_.set_velocity(id, left * now.linear_velocity, left * now.angular_velocity);
  }
}

void RestingEngine::join(std::uint32_t one, std::uint32_t other) noexcept {
  const std::uint32_t a = root(one), b = root(other);
  if (a == b) return;
  things_[b].parent = a;
  std::swap(things_[a].next, things_[b].next);  // joins two rings
}

void RestingEngine::put_to_sleep() {
  for (const BodyId id : awake_) things_[root(index(id))].kept_awake = false;
  for (const BodyId id : awake_) things_[root(index(id))].kept_awake |= !may_sleep(index(id));
  for (const BodyId id : awake_) {
    if (!things_[root(index(id))].kept_awake) slept_.push_back(id);
  }
  for (const BodyId id : slept_) sleep(index(id));
  std::erase_if(awake_, [this](BodyId id) { return asleep(id); });
}

void RestingEngine::sleep(std::uint32_t one) {
  Thing& thing = things_[one];
  const BodyState now = inner_.state(BodyId{one});
  thing.anchor = {now.position, now.orientation, Vec3::Zero(), Vec3::Zero()};
  thing.bounds = inner_.bounds(BodyId{one});
  thing.asleep = true;
  thing.patience_s = kStillFor_s;
  inner_.remove(BodyId{one});
  ++asleep_count_;
}

}  // namespace subworld
