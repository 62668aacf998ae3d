#include "physics/contact_totals.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace subworld {

namespace {

constexpr std::size_t kUsualContacts = 4096;

}  // namespace

ContactTotals::ContactTotals() {
  collected_.reserve(kUsualContacts);
  by_pair_.reserve(kUsualContacts);
  contacts_.reserve(kUsualContacts);
  last_seen_.reserve(kUsualContacts);
}

void ContactTotals::clear() noexcept {
  collected_.clear();
  contacts_.clear();
}

void ContactTotals::add(const Contact& contact, int substep, double reach_m) {
  collected_.push_back({contact, substep, reach_m});
}

void ContactTotals::merge() {
  by_pair_.resize(collected_.size());
  std::iota(by_pair_.begin(), by_pair_.end(), 0U);
  std::sort(by_pair_.begin(), by_pair_.end(), [this](std::uint32_t x, std::uint32_t y) {
    const Contact& first = collected_[x].contact;
    const Contact& second = collected_[y].contact;
    return std::tuple(first.a, first.b, x) < std::tuple(second.a, second.b, y);
  });
  std::size_t pair_begin = 0;  // of the pair in hand, in contacts_
  contacts_.clear();
  last_seen_.clear();
  for (const std::uint32_t i : by_pair_) {
    const Collected& next = collected_[i];
    if (!contacts_.empty() && (contacts_.back().a != next.contact.a || contacts_.back().b != next.contact.b)) {
      pair_begin = contacts_.size();
    }
    const std::size_t known = find(next, pair_begin);
    if (known == contacts_.size()) {
      contacts_.push_back(next.contact);
      last_seen_.push_back(next.substep);
      continue;
    }
    Contact& sum = contacts_[known];
    const double normal_impulse = sum.normal_impulse + next.contact.normal_impulse;
    const Vec3 tangential_impulse = sum.tangential_impulse + next.contact.tangential_impulse;
    sum = next.contact;
    sum.normal_impulse = normal_impulse;
    sum.tangential_impulse = tangential_impulse;
    last_seen_[known] = next.substep;
  }
  collected_.clear();
}

std::size_t ContactTotals::find(const Collected& wanted, std::size_t begin) const {
  double nearest_squared = wanted.reach_m * wanted.reach_m;
  std::size_t nearest = contacts_.size();
  for (std::size_t i = begin; i < contacts_.size(); ++i) {
    const double squared = (contacts_[i].point - wanted.contact.point).squaredNorm();
    if (last_seen_[i] == wanted.substep || squared > nearest_squared) continue;
    nearest_squared = squared;
    nearest = i;
  }
  return nearest;
}

}  // namespace subworld
