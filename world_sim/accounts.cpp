#include "world_sim/accounts.hpp"

#include "coupling/tool/virtual_coupling.hpp"
#include "model/hash.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"

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

WorldAccounts::WorldAccounts(const Scene& scene, std::uint64_t remembered_cycles)
    : scene_(scene),
      motions_(scene.bodies.size()),
      energy_j_(remembered_cycles, 0.0),
      operators_(others_capacity_j(scene, static_cast<std::size_t>(scene.settings.users))),
      in_springs_j_(scene.bodies.size(), 0.0) {
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    if (has_spring(scene.joints[j])) springs_.push_back(j);
  }
}

void WorldAccounts::break_joint(std::size_t joint) {
  if (std::erase(springs_, joint) > 0) in_springs_j_[index(scene_.joints[joint].a)] = 0.0;
}

void WorldAccounts::observe_springs(const RestingEngine& engine) {
  for (const std::size_t j : springs_) in_springs_j_[index(scene_.joints[j].a)] = 0.0;
  for (const std::size_t j : springs_) {
    const Joint& joint = scene_.joints[j];
    in_springs_j_[index(joint.a)] +=
        spring_energy(joint, pose_of(engine.state(joint.a)), pose_of(engine.state(joint.b)));
  }
}

void WorldAccounts::sleeps(const RestingEngine& engine, BodyId id) {
  Motion& motion = motions_[index(id)];
  motion = {.state = engine.state(id), .least_j = motion.least_j};
  motion.energy_j = potential_j(id);
  motion.least_j = std::min(motion.least_j, motion.energy_j);
  resting_j_ += motion.energy_j;
}

void WorldAccounts::follow_rest(const RestingEngine& engine) {
  for (const BodyId id : engine.woke()) resting_j_ -= potential_j(id);
  for (const BodyId id : engine.fell_asleep()) sleeps(engine, id);
}

double WorldAccounts::potential_j(BodyId id) const noexcept {
  const Body& body = scene_.body(id);
  const double of_weight_j =
      body.gravity ? -body.mass * scene_.settings.world.gravity.dot(motions_[index(id)].state.position) : 0.0;
  return of_weight_j + in_springs_j_[index(id)];
}

void WorldAccounts::observe(const RestingEngine& engine, std::span<const RatedTool> tools, WorldFacts& facts) {
  facts.kinetic_j = 0.0;
  facts.potential_j = resting_j_;
  observe_springs(engine);
  above_least_j_ = 0.0;
  for (const BodyId id : engine.awake()) {
    const Body& body = scene_.body(id);
    const BodyState s = engine.state(body.id);
    Motion& motion = motions_[index(body.id)];
    if (facts.stamp > 0) motion.acceleration = (s.linear_velocity - motion.state.linear_velocity) / facts.cycle_s;
    motion.state = s;
    mix(facts.state_hash, s);
    facts.finite = facts.finite && finite(s);
    const double kinetic_j = kinetic_energy(body, s), potential = potential_j(id);
    motion.energy_j = kinetic_j + potential;
    motion.fallen_j = std::isfinite(motion.least_j) ? std::max(0.0, motion.least_j - motion.energy_j) : 0.0;
    motion.least_j = std::min(motion.least_j, motion.energy_j);
    above_least_j_ += motion.energy_j - motion.least_j;
    fallen_j_ += motion.fallen_j;
    facts.kinetic_j += kinetic_j;
    facts.potential_j += potential;
  }
  double of_operators_j = 0.0;
  for (std::size_t u = 0; u < tools.size(); ++u) {
    const BodyId proxy = scene_.users[u].proxy;
    const BodyState& s = motions_[index(proxy)].state;
    const double proxy_j = kinetic_energy(tools[u].at_rate().body, s);
    facts.kinetic_j += proxy_j - kinetic_energy(scene_.body(proxy), s);
    of_operators_j += proxy_j;
  }
  const double energy_j = facts.kinetic_j + facts.potential_j;
  // The proxies' kinetic energy is the operators' work.
  const double of_bodies_j = energy_j - of_operators_j;
  // What nobody explains is not the bodies' to release.
  const double had_j = std::min(of_bodies_j_, explained_j_);
  facts.released_j += facts.stamp > 0 ? std::max(0.0, had_j - of_bodies_j) : of_operators_j;
  of_bodies_j_ = of_bodies_j;
  energy_j_[facts.stamp % energy_j_.size()] = energy_j;
}

void WorldAccounts::resume(const WorldCheckpoint& from, const RestingEngine& engine, std::span<const RatedTool> tools,
                           WorldFacts& facts) {
  for (const BodyId id : engine.awake()) motions_[index(id)] = {.state = engine.state(id)};
  observe(engine, tools, facts);
  facts.state_hash = from.state_hash;
  facts.released_j = from.released_j;
  facts.energy_excess_j = from.energy_excess_j;
  facts.operators_created_j = created_before_j_ = from.operators_created_j;
  // The users' work is counted from here on, so the energy is too.
  begin(facts);
}

void WorldAccounts::balance(std::span<const UserLink> links, WorldFacts& facts) {
  // Energy and work of one stamp: the newest that all users have reported.
  double given_j = 0.0, stored_j = 0.0, operators_j = 0.0;
  const double capacity_j = others_capacity_j(scene_, links.size());
  for (const UserLink& link : links) {
    const HapticReport& report = link.reports().newest();
    if (!link.reports().heard() || report.stamp != links.front().reports().newest().stamp) return;
    given_j += report.device_work_j - report.coupling_energy_j;
    stored_j += report.coupling_energy_j;
    operators_j += report.operator_work_j;
  }
  fallen_j_ = std::min(fallen_j_, capacity_j);
  operators_.keep(above_least_j_);
  operators_.flow(operators_j - operators_.net_j(), stored_j > capacity_j, fallen_j_);
  facts.operators_created_j = created_before_j_ + operators_.created_j();
  if (links.empty()) return;
  const std::uint64_t stamp = links.front().reports().newest().stamp;
  if (stamp + energy_j_.size() <= facts.stamp) return;
  const double energy_j = energy_j_[stamp % energy_j_.size()];
  facts.energy_excess_j = std::max(facts.energy_excess_j, energy_j - start_energy_j_ - motors_j_ - given_j);
  explained_j_ = start_energy_j_ + motors_j_ + given_j;
}

}  // namespace subworld
