// Frames for several users: whom they feel, where those are, and whose energy they may receive.
#include "world_sim/frame_maker.hpp"

#include "coupling/select/swept_bounds.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

void FrameMaker::begin_peers(const WorldNow& now, std::span<const UserLink> links) {
  double longest_s = 0.0;
  for (std::size_t u = 0; u < users_.size(); ++u) {
    users_[u].near_for_s = kNever_s;
    longest_s = std::max(longest_s, horizon_s(now, links[u]));
  }
  peers_.begin(now.contacts, proxies_, [&](BodyId proxy, std::vector<BodyId>& out) {
    out = near(users_[user_of_[index(proxy)]], now, longest_s);
  });
}

const std::vector<BodyId>& FrameMaker::near(User& user, const WorldNow& now, double horizon_s) {
  if (user.near_for_s == horizon_s) return user.near;
  user.near_for_s = horizon_s;
  const BodyId proxy = user.spec->proxy;
  const double gravity_m_s2 = scene_.settings.world.gravity.norm();
  now.engine.overlap(swept_bounds(now.engine.state(proxy), now.engine.bounds(proxy), gravity_m_s2, horizon_s),
                     user.near);
  return user.near;
}

void FrameMaker::find_peers(User& user, const WorldNow& now, double horizon_s, std::vector<BodyId>& bodies) {
  if (users_.size() < 2) return;
  const auto reachable = [&](BodyId proxy, std::vector<BodyId>& out) {
    out = near(users_[user_of_[index(proxy)]], now, horizon_s);
  };
  const auto fits = [&](std::size_t island, std::size_t contacts) {
    return user.budget.cost.of(island, contacts) <= user.budget.limit_s / user.selection.cost_factor;
  };
  const auto felt = peers_.find(user.spec->proxy, now.graph, reachable, fits, bodies);
  user.felt.assign(felt.begin(), felt.end());
}

void FrameMaker::list_peers(const User& user, const WorldNow& now, std::span<const UserLink> links,
                            WorldFrame& frame) const {
  frame.peers.clear();
  for (std::size_t p = 0; p < users_.size(); ++p) {
    const UserSpec& spec = *users_[p].spec;
    const bool own = &users_[p] == &user;
    const auto list_held = [&] {
      if (!links[p].holds()) return false;
      frame.peers.push_back(
          {.proxy = spec.proxy, .pose = links[p].device(now.engine.state(spec.proxy)).pose, .device_s = kHeldDevice_s});
      return true;
    };
    if (own && !links[p].awaits()) (void)list_held();
    if (own || !scheme_.properties.replicates_peers) continue;
    const bool inside = std::ranges::binary_search(frame.members, spec.proxy);
    const bool pushes = std::ranges::find(user.border.pushing, spec.proxy) != user.border.pushing.end();
    if ((!inside && !pushes) || list_held() || !links[p].reports().heard()) continue;
    const HapticReport& report = links[p].reports().at(now.stamp);
    if (!report.device) continue;
    const ReportedDevice& at_report = *report.device;
    const double passed_s = std::min(now.stamp_s - report.stamp_s, report.clock_rate * kLongestGuess_s);
    PeerDevice device{.proxy = spec.proxy,
                      .pose = at_report.pose,
                      .linear_velocity = at_report.linear_velocity,
                      .angular_velocity = at_report.angular_velocity,
                      .applied = at_report.applied,
                      .device_s = at_report.device_s + passed_s / report.clock_rate,
                      .offset = at_report.offset,
                      .turn = at_report.turn};
    device.pose.position += passed_s * device.linear_velocity;
    frame.peers.push_back(device);
  }
}

void FrameMaker::note_work(std::span<const UserLink> links) {
  for (std::size_t u = 0; u < users_.size(); ++u) {
    const double now_j = links[u].reports().heard() ? links[u].reports().newest().operator_work_j : operators_j_[u];
    work_j_[u] = now_j - std::exchange(operators_j_[u], now_j);
  }
}

void FrameMaker::count_energy(User& user, const WorldNow& now, WorldFrame& frame) {
  const auto visit = [this](BodyId id) {
    if (visited_[index(id)]) return;
    visited_[index(id)] = true;
    scratch_.push_back(id);
  };
  scratch_.clear();
  frame.bodies_j = 0.0;
  std::ranges::for_each(frame.members, visit);  // the sub-world goes on from their energies
  for (std::size_t k = 0; k < scratch_.size(); ++k) {
    for (const Neighbour& n : now.graph.neighbours(scratch_[k])) {
      if (!scene_.body(n.body).fixed()) visit(n.body);
    }
    const bool of_operator = std::ranges::find(proxies_, scratch_[k]) != proxies_.end();
    const Motion& motion = now.motions[index(scratch_[k])];
    if (of_operator || motion.least_j > motion.energy_j) continue;
    user.outside_work_j += motion.fallen_j;
    frame.bodies_j += motion.energy_j - motion.least_j;
  }
  for (const BodyId id : scratch_) visited_[index(id)] = false;
}

void FrameMaker::count_outside_work(User& user, WorldFrame& frame) const {
  for (const PeerContact& felt : user.felt) {
    const auto is_felt = [&](const User& other) { return other.spec->proxy == felt.proxy; };
    const auto peer = static_cast<std::size_t>(std::ranges::find_if(users_, is_felt) - users_.begin());
    const bool inside = std::ranges::find(frame.peers, felt.proxy, &PeerDevice::proxy) != frame.peers.end() &&
                        std::ranges::binary_search(frame.members, felt.proxy);
    if (!inside) user.outside_work_j += work_j_[peer];
  }
  frame.outside_work_j = user.outside_work_j;
}

}  // namespace subworld
