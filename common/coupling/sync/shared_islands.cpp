#include "coupling/sync/shared_islands.hpp"

#include "coupling/select/contact_graph.hpp"
#include "coupling/sync/blend.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace subworld {

namespace {

constexpr double kSettled = 8.0;  ///< cycles; by then a correction of a half a cycle has taken an entry's error away

}  // namespace

SharedIslands::SharedIslands(const Scene& scene) : scene_(scene), copies_(scene.bodies.size()) {
  const auto users = static_cast<std::size_t>(scene.settings.users);
  owners_.assign(scene.bodies.size(), users);
  for (std::size_t u = 0; u < users; ++u) owners_[index(scene.users[u].proxy)] = u;
}

void SharedIslands::join(BodyId a, BodyId b) noexcept {
  const std::uint32_t root_a = sets_.root(copies_[index(a)].place);
  const std::uint32_t root_b = sets_.root(copies_[index(b)].place);
  if (root_a == root_b) return;
  islands_[root_a].open = islands_[root_a].open || islands_[root_b].open;
  sets_.join(root_a, root_b);
}

void SharedIslands::join(const HapticReport& report) noexcept {
  const std::vector<StampedBody>& members = report.members;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::uint32_t label = i < report.islands.size() ? report.islands[i] : kOpenIsland;
    if (label < members.size()) {
      join(members[i].id, members[label].id);
    } else {
      island(members[i].id).open = true;
    }
  }
}

void SharedIslands::hold(std::span<const HapticReport* const> reports) {
  for (const BodyId id : held_) {
    Copies& copies = copies_[index(id)];
    copies.before = std::exchange(copies.holders, 0);
  }
  before_.swap(held_);
  held_.clear();
  for (std::size_t u = 0; u < reports.size(); ++u) {
    if (reports[u] == nullptr) continue;
    for (const StampedBody& member : reports[u]->members) {
      Copies& copies = copies_[index(member.id)];
      if (copies.holders == 0) {
        copies.place = static_cast<std::uint32_t>(held_.size());
        held_.push_back(member.id);
      }
      copies.holders |= std::uint64_t{1} << u;
    }
  }
  for (const BodyId id : before_) {
    if (!held(id)) copies_[index(id)] = {};
  }
  for (const BodyId id : held_) {
    Copies& copies = copies_[index(id)];
    copies.cycles = copies.holders == copies.before ? copies.cycles + 1 : 0;
  }
}

BodyState SharedIslands::mean(BodyId id, std::span<const HapticReport* const> reports) const {
  const auto copy = [&](std::size_t user) { return find_sorted(reports[user]->members, id, &StampedBody::id)->state; };
  const std::uint64_t holders = copies_[index(id)].holders;
  const std::size_t owner = owners_[index(id)];
  if (owner < reports.size() && (holders >> owner & 1U) != 0) return copy(owner);
  BodyState sum;
  double count = 0.0;
  for (std::size_t u = 0; u < reports.size(); ++u) {
    if ((holders >> u & 1U) == 0) continue;
    count += 1.0;
    sum = count == 1.0 ? copy(u) : blend(sum, copy(u), 1.0 / count);
  }
  return sum;
}

std::span<const MergedBody> SharedIslands::merge(std::span<const Contact> contacts,
                                                 std::span<const HapticReport* const> reports, double cycle_s) {
  merged_.clear();
  hold(reports);
  if (std::ranges::find(reports, nullptr) != reports.end()) return merged_;
  const auto is_shared = [this](BodyId id) { return std::popcount(copies_[index(id)].holders) > 1; };
  if (std::ranges::none_of(held_, is_shared)) return merged_;
  sets_.reset(held_.size());
  islands_.assign(held_.size(), {});
  for (const Contact& c : contacts) {
    if (scene_.body(c.a).fixed() || scene_.body(c.b).fixed()) continue;
    if (held(c.a) && held(c.b)) {
      join(c.a, c.b);
    } else if (held(c.a) || held(c.b)) {
      island(held(c.a) ? c.a : c.b).open = true;
    }
  }
  for (const HapticReport* const report : reports) join(*report);
  // Each body of an island has the same holders, or part of it lies outside one of them.
  for (const BodyId id : held_) {
    Island& of = island(id);
    const Copies& copies = copies_[index(id)];
    of.open = of.open || (of.holders != 0 && of.holders != copies.holders);
    of.cycles = of.holders == 0 ? copies.cycles : std::min(of.cycles, copies.cycles);
    of.holders = copies.holders;
  }
  for (std::size_t u = 0; u < reports.size(); ++u) {
    for (const StampedBody& member : reports[u]->members) {
      Island& of = island(member.id);
      of.age_s = std::max(of.age_s, reports[u]->peer_age_s);
    }
  }
  for (const BodyId id : held_) {
    const Island& of = island(id);
    if (of.open || std::popcount(of.holders) < 2) continue;
    const double weight = std::max(0.0, 1.0 - of.age_s / cycle_s) * std::min(1.0, of.cycles / kSettled);
    if (weight > 0.0) merged_.push_back({id, mean(id, reports), weight});
  }
  std::ranges::sort(merged_, {}, &MergedBody::id);
  return merged_;
}

}  // namespace subworld
