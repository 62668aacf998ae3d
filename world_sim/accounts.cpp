#include "coupling/virtual_coupling.hpp"
#include "model/hash.hpp"
#include "world_sim/world.hpp"

#include <algorithm>
#include <bit>

namespace subworld {

namespace {

void mix(std::uint64_t& hash, double value) noexcept {
  hash = hashed(hash, std::bit_cast<std::uint64_t>(value));
  hash ^= hash >> 32;
}

void mix(std::uint64_t& hash, const BodyState& s) noexcept {
  for (int i = 0; i < 3; ++i) mix(hash, s.position[i]);
  for (int i = 0; i < 4; ++i) mix(hash, s.orientation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) mix(hash, s.linear_velocity[i]);
  for (int i = 0; i < 3; ++i) mix(hash, s.angular_velocity[i]);
}

}  // namespace

void World::count_asleep(BodyId id) {
  motions_[index(id)] = {.state = engine_.state(id)};
  resting_j_ += potential_j(id);
}

double World::potential_j(BodyId id) const noexcept {
  const Body& body = scene_.body(id);
  return body.gravity ? -body.mass * scene_.settings.world.gravity.dot(motions_[index(id)].state.position) : 0.0;
}

void World::account() {
  facts_.kinetic_j = 0.0;
  facts_.potential_j = resting_j_;
  for (const BodyId id : engine_.awake()) {
    const Body& body = scene_.body(id);
    const BodyState s = engine_.state(body.id);
    Motion& motion = motions_[index(body.id)];
    if (facts_.stamp > 0) motion.acceleration = (s.linear_velocity - motion.state.linear_velocity) / facts_.cycle_s;
    motion.state = s;
    mix(facts_.state_hash, s);
    facts_.finite = facts_.finite && finite(s);
    facts_.kinetic_j += kinetic_energy(body, s);
    facts_.potential_j += potential_j(id);
  }
  double of_operators_j = 0.0;
  for (const User& user : users_) {
    const BodyState& s = motions_[index(user.spec->proxy)].state;
    const double proxy_j = kinetic_energy(user.tool.body, s);
    facts_.kinetic_j += proxy_j - kinetic_energy(scene_.body(user.spec->proxy), s);
    of_operators_j += proxy_j;
  }
  const double energy_j = facts_.kinetic_j + facts_.potential_j;
  // The proxies' kinetic energy is the operators' work.
  const double of_bodies_j = energy_j - of_operators_j;
  facts_.released_j += facts_.stamp > 0 ? std::max(0.0, of_bodies_j_ - of_bodies_j) : of_operators_j;
  of_bodies_j_ = of_bodies_j;
  energy_j_[facts_.stamp % remembered_] = energy_j;
}

void World::balance() {
  // Energy and work of one stamp: the newest that all users have reported.
  double given_j = 0.0, stored_j = 0.0, operators_j = 0.0;
  for (const User& user : users_) {
    if (!user.heard || user.report.stamp != users_.front().report.stamp) return;
    given_j += user.report.device_work_j - user.report.coupling_energy_j;
    stored_j += user.report.coupling_energy_j;
    operators_j += user.report.operator_work_j;
  }
  double none_j = 0.0;
  const bool at_limit = stored_j > others_capacity_j(scene_, users_.size());
  operators_.flow(operators_j - operators_.net_j(), at_limit, none_j);
  facts_.operators_created_j = created_before_j_ + operators_.created_j();
  if (users_.empty() || users_.front().report.stamp + remembered_ <= facts_.stamp) return;
  const double energy_j = energy_j_[users_.front().report.stamp % remembered_];
  facts_.energy_excess_j = std::max(facts_.energy_excess_j, energy_j - start_energy_j_ - given_j);
}

}  // namespace subworld
