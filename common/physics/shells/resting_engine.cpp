#include "physics/shells/resting_engine.hpp"

#include "model/error.hpp"
#include "model/shapes/reach.hpp"
#include "model/shapes/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kLookEvery_s = 0.05;  ///< interval of the search for bodies that may sleep or settle
constexpr double kMostLonger = 100.0;  ///< factor of kStillFor_s in weak gravity

double gap_m(const Box& a, const Box& b) noexcept {
  return (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0).norm();
}

}  // namespace

RestingEngine::RestingEngine(Engine& inner, const Scene& scene, std::span<const BodyId> restless, bool rests,
                             bool settles)
    : inner_(inner),
      scene_(scene),
      rests_(rests),
      gravity_m_s2_(scene.settings.world.gravity.norm()),
      still_for_s_(kStillFor_s *
                   std::clamp(gravity_m_s2_ > 0.0 ? std::sqrt(kUsual_m_s2 / gravity_m_s2_) : 1.0, 1.0, kMostLonger)),
      settling_(scene, rests && settles),
      things_(scene.bodies.size()),
      still_(rests ? scene.bodies.size() : 0) {
  sets_.reset(scene.bodies.size());
  for (const BodyId id : restless) things_[index(id)].restless = true;
  for (std::vector<BodyId>* list : {&awake_, &waking_, &woke_, &slept_}) list->reserve(scene.bodies.size());
  frontier_.reserve(scene.bodies.size() + 1);
  reached_.reserve(scene.bodies.size());
  near_.reserve(scene.bodies.size());
  islands_.reserve(scene.bodies.size());
  together_.reserve(scene.bodies.size());
}

void RestingEngine::add(const Body& body, const BodyState& state, Role role) {
  Thing& thing = things_[index(body.id)];
  // A joint to a body that is asleep would not act.
  const auto joins = [&](const Joint& joint) { return joint.joins(body.id); };
  const bool sleeps = rests_ && body.at_rest && !thing.restless && std::ranges::none_of(scene_.joints, joins);
  if (!sleeps) inner_.add(body, state, role);
  if (body.fixed()) return;
  thing.anchor = state;
  thing.still_s = 0.0;
  separate(index(body.id));
  const Box box = subworld::bounds(body.shape, {}, scene_.meshes);
  thing.arm_m = box.lower.cwiseAbs().cwiseMax(box.upper.cwiseAbs()).norm();
  thing.thickness_m = thickness(body.shape, scene_.meshes);
  thing.drift_m = thing.tolerance_m = kDrift * thing.thickness_m;
  settling_.add(body, thing.thickness_m, thing.arm_m, !thing.restless);
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
  thing.still_s = thing.unreached_s = still_for_s_;
  const Box box = thing.bounds.grown(thing.drift_m);
  still_.find(box, [&](std::uint32_t other) {
    if (things_[other].asleep) join(one, other);
  });
  still_.insert(one, box);
  ++asleep_count_;
}

Engine& RestingEngine::moved(BodyId id) {
  if (asleep(id)) {
    wake(index(id));
    settling_.restart(id);
  }
  return inner_;
}

void RestingEngine::remove(BodyId id) {
  moved(id).remove(id);
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

bool RestingEngine::negligible(BodyId id, const BodyState& to) const {
  const Thing& thing = things_[index(id)];
  return moved_m(thing.anchor, to, thing.arm_m) <= thing.drift_m;
}

void RestingEngine::asleep_in(const Box& box, std::vector<BodyId>& out) const {
  out.clear();
  if (asleep_count_ == 0) return;
  still_.find(box, [&](std::uint32_t item) {
    if (things_[item].asleep) out.push_back(BodyId{item});
  });
}

void RestingEngine::stepped(double dt) {
  if (!rests_) return;
  since_look_s_ += dt;
  if (since_look_s_ < kLookEvery_s) return;
  since_look_s_ = 0.0;
  find_islands(dt);  // while the contacts are valid
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
    find_operators(horizon_s);
    judge_islands();
  }
  settling_.damp(awake_, inner_, dt);
}

void RestingEngine::watch(BodyId id, double dt) {
  Thing& thing = things_[index(id)];
  const BodyState now = inner_.state(id);
  settling_.watch(id, now, now.linear_velocity.norm() + thing.arm_m * now.angular_velocity.norm(), dt);
  const bool settled = settling_.has_settled(id);
  if (!settled) thing.tolerance_m = thing.drift_m;
  thing.still_s += dt;
  thing.unreached_s += dt;
  if (moved_m(thing.anchor, now, thing.arm_m) > thing.tolerance_m) {
    const bool creeps = settled && thing.still_s >= Settling::kCreep_s;
    thing.anchor = now;
    if (settled) thing.tolerance_m = Settling::kTremble * thing.thickness_m;
    thing.still_s = creeps ? still_for_s_ : 0.0;
    if (!creeps) thing.unreached_s = 0.0;
    if (still_.contains(index(id))) still_.remove(index(id));
  }
  if (thing.restless || thing.still_s < still_for_s_ || still_.contains(index(id))) return;
  thing.bounds = inner_.bounds(id);
  // The full range of positions around the anchor.
  still_.insert(index(id), thing.bounds.grown(2.0 * thing.tolerance_m));
}

void RestingEngine::reach_from(BodyId mover, double horizon_s) {
  const Thing& thing = things_[index(mover)];
  const BodyState now = inner_.state(mover);
  const double acceleration_m_s2 = thing.restless ? kOperator_m_s2 : gravity_m_s2_;  // other bodies fall, or are pushed
  const double travel_m = reach_m(now, thing.arm_m, acceleration_m_s2, horizon_s) + thing.drift_m;
  frontier_.assign(1, {inner_.bounds(mover), travel_m});
  double hit = kHit;  // factor for bodies hit by the mover itself; bodies hit in turn count as equally fast
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
    settling_.wakes(id);
    separate(index(id));
    inner_.add(scene_.body(id), thing.anchor, Role::body);
    --asleep_count_;
  }
}

void RestingEngine::wake_all() {
  for (std::uint32_t i = 0; i < things_.size(); ++i) {
    if (things_[i].asleep) wake(i);
  }
}

void RestingEngine::find_islands(double dt) {
  looked_at_s_ = dt;
  for (const BodyId id : awake_) {
    separate(index(id));
    things_[index(id)].pushed_n_s = Vec3::Zero();
  }
  settling_.begin_contacts(awake_);
  for (const Contact& c : inner_.contacts()) {
    const bool a_fixed = scene_.body(c.a).fixed(), b_fixed = scene_.body(c.b).fixed();
    const Vec3 on_a = c.normal_impulse * c.normal + c.tangential_impulse;
    if (b_fixed) things_[index(c.a)].pushed_n_s += on_a;
    if (a_fixed) things_[index(c.b)].pushed_n_s -= on_a;
    if (!a_fixed && !b_fixed) join(index(c.a), index(c.b));
    settling_.touches(c);
  }
  islands_known_ = true;
}

bool RestingEngine::are_held(std::span<const BodyId> together) const {
  Vec3 pushed_n_s = Vec3::Zero();
  double heavy_kg = 0.0;
  for (const BodyId id : together) {
    pushed_n_s += things_[index(id)].pushed_n_s;
    if (scene_.body(id).gravity) heavy_kg += scene_.body(id).mass;
  }
  const Vec3 weight_n_s = heavy_kg * looked_at_s_ * scene_.settings.world.gravity;
  if (!weight_n_s.isZero(0.0)) return (pushed_n_s + weight_n_s).norm() <= kHeld * weight_n_s.norm();
  return std::ranges::all_of(together, [this](BodyId id) {
    const Thing& thing = things_[index(id)];
    const BodyState now = inner_.state(id);
    return now.linear_velocity.norm() + thing.arm_m * now.angular_velocity.norm() <= kFloats_per_s * thing.thickness_m;
  });
}

void RestingEngine::find_operators(double horizon_s) {
  for (const BodyId id : awake_) things_[sets_.root(index(id))].in_reach = false;
  for (const BodyId id : awake_) {
    const Thing& thing = things_[index(id)];
    if (!thing.restless) continue;
    const double travel_m = reach_m(inner_.state(id), thing.arm_m, kOperator_m_s2, kLookEvery_s + horizon_s);
    inner_.overlap(inner_.bounds(id).grown(travel_m), near_);
    for (const BodyId near : near_) {
      if (!scene_.body(near).fixed()) things_[sets_.root(index(near))].in_reach = true;
    }
  }
}

void RestingEngine::join(std::uint32_t one, std::uint32_t other) noexcept {
  const std::uint32_t a = sets_.root(one), b = sets_.root(other);
  if (a == b) return;
  sets_.join(a, b);
  std::swap(things_[a].next, things_[b].next);  // joins two rings
}

void RestingEngine::judge_islands() {
  islands_.clear();
  for (const BodyId id : awake_) islands_.emplace_back(sets_.root(index(id)), id);
  std::ranges::sort(islands_);
  for (auto one = islands_.begin(); one != islands_.end();) {
    const std::uint32_t island = one->first;
    together_.clear();
    for (; one != islands_.end() && one->first == island; ++one) together_.push_back(one->second);
    const auto is_still = [this](BodyId id) { return still_.contains(index(id)); };
    const auto is_unreached = [this](BodyId id) { return things_[index(id)].unreached_s >= still_for_s_; };
    const bool sways = !std::ranges::all_of(together_, is_still);
    settling_.judge(together_, sways, things_[island].in_reach, inner_);
    if (sways || !std::ranges::all_of(together_, is_unreached) || !are_held(together_)) continue;
    slept_.insert(slept_.end(), together_.begin(), together_.end());
  }
  std::ranges::sort(slept_);
  for (const BodyId id : slept_) sleep(index(id));
  inner_.remove_all(slept_);
  std::erase_if(awake_, [this](BodyId id) { return asleep(id); });
}

void RestingEngine::sleep(std::uint32_t one) {
  Thing& thing = things_[one];
  const BodyState now = inner_.state(BodyId{one});
  thing.anchor = {now.position, now.orientation, Vec3::Zero(), Vec3::Zero()};
  thing.bounds = inner_.bounds(BodyId{one});
  thing.asleep = true;
  settling_.sleeps(BodyId{one});
  ++asleep_count_;
}

}  // namespace subworld
