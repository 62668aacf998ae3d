#include "lab/random/energy_book.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

Vec3 spin(const BodyState& s) { return s.orientation.conjugate() * s.angular_velocity; }

}  // namespace

BookedEngine::Entry* BookedEngine::find(BodyId id) noexcept {
  return index(id) < entries_.size() && entries_[index(id)] ? &*entries_[index(id)] : nullptr;
}

/// Equation (1), the potential part.
double BookedEngine::potential_j(const Entry& entry, const BodyState& s) const noexcept {
  return entry.body.gravity ? -entry.body.mass * gravity_.dot(s.position - ahead_s_ * s.linear_velocity) : 0.0;
}

void BookedEngine::total() noexcept {
  book_.energy_j = book_.reading_j = 0.0;
  for (const auto& entry : entries_) {
    if (!entry) continue;
    book_.energy_j += kinetic_energy(entry->body, entry->before) + potential_j(*entry, entry->before);
    if (entry->body.gravity)
      book_.reading_j += entry->body.mass * ahead_s_ * std::abs(gravity_.dot(entry->before.linear_velocity));
  }
}

void BookedEngine::rebase() noexcept {
  const double before_j = book_.energy_j;
  total();
  book_.begin_j += book_.energy_j - before_j;
}

void BookedEngine::begin() {
  for (auto& entry : entries_) {
    if (!entry) continue;
    entry->before = inner_->state(entry->body.id);
    entry->potential_j = potential_j(*entry, entry->before);
  }
  total();
  book_ = {.begin_j = book_.energy_j, .energy_j = book_.energy_j, .reading_j = book_.reading_j};
  for (const auto& entry : entries_) {
    if (entry) book_.kinetic_j += kinetic_energy(entry->body, entry->before);
  }
}

void BookedEngine::add(const Body& body, const BodyState& state, Role role) {
  inner_->add(body, state, role);
  if (body.fixed()) return;
  if (entries_.size() <= index(body.id)) entries_.resize(index(body.id) + 1);
  Entry& entry = entries_[index(body.id)].emplace();
  entry.body = nameless(body);
  entry.mass = body.mass;
  entry.inertia = body.inertia;
  entry.before = state;
  entry.potential_j = potential_j(entry, state);
  rebase();
}

void BookedEngine::remove(BodyId id) {
  inner_->remove(id);
  if (find(id) == nullptr) return;
  entries_[index(id)].reset();
  rebase();
}

/// Equation (4).
bool BookedEngine::set_state(BodyId id, const BodyState& state) {
  const bool taken = inner_->set_state(id, state);
  Entry* entry = find(id);
  if (entry == nullptr || !taken) return taken;
  const double before_j = kinetic_energy(entry->body, entry->before) + potential_j(*entry, entry->before);
  entry->before = inner_->state(id);
  entry->potential_j = potential_j(*entry, entry->before);
  const double by_j = kinetic_energy(entry->body, entry->before) + entry->potential_j - before_j;
  book_.corrected_j += by_j;
  book_.given_j += std::max(0.0, by_j);
  book_.energy_j += by_j;
  return taken;
}

bool BookedEngine::set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) {
  return inner_->set_velocity(id, linear, angular);  // contributes to J, equation (2)
}

void BookedEngine::set_inertia(BodyId id, double mass, const Vec3& inertia) {
  inner_->set_inertia(id, mass, inertia);
  if (Entry* entry = find(id)) {
    entry->mass = mass;
    entry->inertia = inertia;
  }
}

bool BookedEngine::apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) {
  return inner_->apply_impulse(id, impulse, point);
}

bool BookedEngine::apply_force(BodyId id, const Vec3& force, const Vec3& torque) {
  const bool taken = inner_->apply_force(id, force, torque);
  if (Entry* entry = find(id); entry != nullptr && taken) {
    entry->force += force;
    entry->torque += torque;
  }
  return taken;
}

/// Equations (2) and (3). `start`: with vs.
double BookedEngine::work_j(const Entry& entry, const BodyState& start, const BodyState& after, double dt) const {
  const Body& body = entry.body;
  const BodyState& before = entry.before;
  const Vec3 &v0 = before.linear_velocity, &v1 = after.linear_velocity;
  const Vec3 impulse =
      dt * entry.force + entry.mass * start.linear_velocity - body.mass * v0 - (entry.mass - body.mass) * v1;
  const Vec3 way = after.position - before.position, mean = 0.5 * (v0 + v1);
  double work_j = entry.touched ? std::max(impulse.dot(v1), impulse.dot(way) / dt) : impulse.dot(mean);
  if (!entry.touched && entry.mass != body.mass && body.gravity)
    work_j += body.mass * gravity_.dot(dt * mean - way + ahead_s_ * (v1 - v0));
  if (!body.rotates) return work_j;
  // Principal axes: each angular velocity in its own body frame.
  const auto middle = [&](const Vec3& w0, const Vec3& w1) { return entry.touched ? w1 : Vec3(0.5 * (w0 + w1)); };
  const Vec3 twist = entry.inertia.cwiseProduct(spin(start)) - body.inertia.cwiseProduct(spin(before)) -
                     Vec3(entry.inertia - body.inertia).cwiseProduct(spin(after));
  return work_j + twist.dot(middle(spin(before), spin(after))) +
         dt * entry.torque.dot(middle(before.angular_velocity, after.angular_velocity));
}

void BookedEngine::find_touched() {
  for (auto& entry : entries_) {
    if (entry) entry->touched = false;
  }
  for (const Contact& c : inner_->contacts()) {
    if (!(c.normal_impulse > 0.0)) continue;
    for (const BodyId id : {c.a, c.b}) {
      if (Entry* entry = find(id)) entry->touched = true;
    }
  }
}

void BookedEngine::step(double dt) {
  // Changes that users made since the last step are not caused by the engine.
  starts_.resize(entries_.size());
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (entries_[i]) starts_[i] = inner_->state(entries_[i]->body.id);
  }
  if (const double ahead_s = 0.5 * inner_->integration_substep_s(dt); ahead_s != ahead_s_) {
    // A sub-step of another length shifts the positions: no change of energy.
    ahead_s_ = ahead_s;
    for (auto& entry : entries_) {
      if (entry) entry->potential_j = potential_j(*entry, entry->before);
    }
    rebase();
  }
  inner_->step(dt);
  find_touched();
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (!entries_[i]) continue;
    Entry& entry = *entries_[i];
    const BodyState after = inner_->state(entry.body.id);
    const double by_j = work_j(entry, starts_[i], after, dt);
    book_.work_j += by_j;
    book_.given_j += std::max(0.0, by_j);
    const double potential = potential_j(entry, after);
    book_.released_j += std::max(0.0, entry.potential_j - potential);
    entry.before = after;
    entry.potential_j = potential;
    entry.force = entry.torque = Vec3::Zero();
  }
  total();
}

}  // namespace subworld
