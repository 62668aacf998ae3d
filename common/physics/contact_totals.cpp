#include "physics/contact_totals.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace subworld {

namespace {

constexpr std::size_t kUsualContacts = 4096;

/// Counting sort costs a step for each id, sorting by comparison some steps for each run. This ratio decides.
constexpr std::size_t kMostIdsPerRun = 16;

std::uint64_t bodies_of(const Contact& contact) { return std::uint64_t{index(contact.a)} << 32 | index(contact.b); }

}  // namespace

ContactTotals::ContactTotals() {
  collected_.reserve(kUsualContacts);
  runs_.reserve(kUsualContacts);
  contacts_.reserve(kUsualContacts);
  last_seen_.reserve(kUsualContacts);
  sorted_.reserve(kUsualContacts);
}

void ContactTotals::clear() noexcept {
  collected_.clear();
  runs_.clear();
  contacts_.clear();
}

void ContactTotals::note(const Contact& contact, std::uint32_t place) {
  const std::uint64_t bodies = bodies_of(contact);
  if (runs_.empty() || runs_.back().bodies != bodies) runs_.push_back({bodies, place, place});
  runs_.back().end = place + 1;
}

void ContactTotals::sort_runs() {
  std::uint32_t last = 0;
  for (const Run& run : runs_) last = std::max({last, second(run), first(run)});
  if (last > kMostIdsPerRun * runs_.size()) {
    std::sort(runs_.begin(), runs_.end(),
              [](const Run& x, const Run& y) { return std::tie(x.bodies, x.begin) < std::tie(y.bodies, y.begin); });
    return;
  }
  sort_by(last, second);
  sort_by(last, first);
}

template <class Id>
void ContactTotals::sort_by(std::uint32_t last, const Id& id) {
  places_.assign(last + 2, 0);
  for (const Run& run : runs_) ++places_[id(run) + 1];
  std::partial_sum(places_.begin(), places_.end(), places_.begin());
  sorted_.resize(runs_.size());
  for (const Run& run : runs_) sorted_[places_[id(run)]++] = run;
  runs_.swap(sorted_);
}

void ContactTotals::take(std::span<const Contact> contacts) {
  clear();
  for (std::uint32_t i = 0; i < contacts.size(); ++i) note(contacts[i], i);
  sort_runs();
  for (const Run& run : runs_) {
    contacts_.insert(contacts_.end(), contacts.begin() + run.begin, contacts.begin() + run.end);
  }
  runs_.clear();
}

void ContactTotals::add(const Contact& contact, int substep, double reach_m) {
  note(contact, static_cast<std::uint32_t>(collected_.size()));
  collected_.push_back({contact, substep, reach_m});
}

void ContactTotals::merge() {
  sort_runs();
  std::size_t pair_begin = 0;  // of the current pair, index in contacts_
  contacts_.clear();
  last_seen_.clear();
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    if (r == 0 || runs_[r].bodies != runs_[r - 1].bodies) pair_begin = contacts_.size();
    for (std::uint32_t i = runs_[r].begin; i < runs_[r].end; ++i) add_up(collected_[i], pair_begin);
  }
  collected_.clear();
  runs_.clear();
}

void ContactTotals::add_up(const Collected& next, std::size_t pair_begin) {
  const std::size_t known = find(next, pair_begin);
  if (known == contacts_.size()) {
    contacts_.push_back(next.contact);
    last_seen_.push_back(next.substep);
    return;
  }
  Contact& sum = contacts_[known];
  const double normal_impulse = sum.normal_impulse + next.contact.normal_impulse;
  const Vec3 tangential_impulse = sum.tangential_impulse + next.contact.tangential_impulse;
  sum = next.contact;
  sum.normal_impulse = normal_impulse;
  sum.tangential_impulse = tangential_impulse;
  last_seen_[known] = next.substep;
}

std::size_t ContactTotals::find(const Collected& wanted, std::size_t begin) const {
  double nearest_squared = wanted.reach_m * wanted.reach_m;
  std::size_t nearest = contacts_.size();
  for (std::size_t i = begin; i < contacts_.size(); ++i) {
    if (last_seen_[i] == wanted.substep) continue;
    const double squared = (contacts_[i].point - wanted.contact.point).squaredNorm();
    if (squared > nearest_squared || contacts_[i].is_joint() != wanted.contact.is_joint()) continue;
    nearest_squared = squared;
    nearest = i;
  }
  return nearest;
}

}  // namespace subworld
