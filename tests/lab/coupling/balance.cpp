#include "lab/coupling/balance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

void CopyDifference::add(double distance_m) noexcept {
  squares_m2_ += distance_m * distance_m;
  max_m_ = std::max(max_m_, distance_m);
  ++count_;
}

void CopyDifference::add(const CopyDifference& other) noexcept {
  squares_m2_ += other.squares_m2_;
  max_m_ = std::max(max_m_, other.max_m_);
  count_ += other.count_;
}

double CopyDifference::rms_m() const noexcept { return std::sqrt(squares_m2_ / static_cast<double>(count_)); }

double CopyDifference::max_m() const noexcept { return count_ > 0 ? max_m_ : std::numeric_limits<double>::quiet_NaN(); }

BalanceWatch::BalanceWatch(const CoupledRun& run, const Scene& scene)
    : run_(run),
      scheme_(scheme_of(scene.settings).properties),
      copies_(run.subs.size()),
      momentum_(run.subs.size(), {.missing_n_s = Vec3::Constant(std::numeric_limits<double>::quiet_NaN())}) {}

void BalanceWatch::observe() {
  const std::uint64_t stamp = run_.world.facts().stamp;
  for (std::size_t u = 0; u < run_.subs.size(); ++u) {
    // What a scheme without a lead passes on in a cycle is that of the cycle before.
    const std::uint64_t passed = stamp + static_cast<std::uint64_t>(scheme_.lead_cycles) - 1;
    const HapticReport* const then = scheme_.has_sub_worlds ? run_.report_of(u, passed) : nullptr;
    if (then != nullptr) momentum_[u].missing_n_s = then->impulse_total.force - run_.world.user_facts(u).impulse.force;
    const HapticReport* const report = run_.report_of(u, stamp);
    if (report == nullptr) continue;
    for (const StampedBody& member : report->members) {
      if (holders_.size() <= index(member.id)) holders_.resize(index(member.id) + 1);
      std::vector<Copy>& holders = holders_[index(member.id)];
      if (holders.empty()) held_.push_back(member.id);
      for (const Copy& other : holders) {
        const double distance_m = (member.state.position - other.position).norm();
        copies_[u].add(distance_m);
        copies_[other.user].add(distance_m);
      }
      holders.push_back({u, member.state.position});
    }
  }
  for (const BodyId id : held_) holders_[index(id)].clear();
  held_.clear();
}

std::vector<UserBalance> BalanceWatch::by_user(double h_s) const {
  std::vector<UserBalance> users;
  for (std::size_t u = 0; u < run_.subs.size(); ++u) {
    MomentumBalance momentum = momentum_[u];
    for (const Vec3& force : run_.felt[u].force) momentum.impulse_n_s += h_s * force.norm();
    users.push_back({.momentum = momentum,
                     .created_j = run_.guards[u]->port().created_j(),
                     .bounded_ratio = run_.guards[u]->bounded_ratio(),
                     .oscillation_n = run_.guards[u]->oscillation().worst_n(),
                     .copies = copies_[u]});
  }
  return users;
}

}  // namespace subworld
