#include "wire/changes.hpp"

#include <algorithm>

namespace subworld {

namespace {

bool same(const BodyState& a, const BodyState& b) noexcept {
  return same_bits(a.position, b.position) && same_bits(a.orientation, b.orientation) &&
         same_bits(a.linear_velocity, b.linear_velocity) && same_bits(a.angular_velocity, b.angular_velocity);
}

bool same(const StampedBody& a, const StampedBody& b) noexcept { return a.id == b.id && same(a.state, b.state); }

bool same(const GhostAxis& a, const GhostAxis& b) noexcept {
  return same_bits(a.normal, b.normal) && same_bits(a.force_n, b.force_n) &&
         same_bits(a.coulomb_limit_n, b.coulomb_limit_n) &&
         same_bits(a.load_dependent_friction, b.load_dependent_friction);
}

bool same(const GhostModel& a, const GhostModel& b) noexcept {
  if (a.outside != b.outside || a.axis_count != b.axis_count || !same_bits(a.mass_kg, b.mass_kg) ||
      !same_bits(a.load_n, b.load_n))
    return false;
  for (std::size_t i = 0; i < a.axis_count; ++i) {
    if (!same(a.axes[i], b.axes[i])) return false;
  }
  return true;
}

bool same_contents(const Base& a, const Base& b) noexcept {
  return a.members == b.members && a.fixed == b.fixed && a.islands == b.islands &&
         std::ranges::equal(a.states, b.states, [](const auto& x, const auto& y) { return same(x, y); }) &&
         std::ranges::equal(a.ghosts, b.ghosts, [](const auto& x, const auto& y) { return same(x, y); });
}

void reserve(Base& base, std::size_t bodies) {
  base.members.reserve(bodies);
  base.fixed.reserve(bodies);
  base.islands.reserve(bodies);
  base.states.reserve(bodies);
  base.ghosts.reserve(bodies);
}

}  // namespace

const Base* Bases::find(const MessageIdentity& identity) const noexcept {
  if (kept_.empty()) return nullptr;
  const Base& base = kept_[identity.stamp % kRememberedBases];
  return base.usable && base.identity == identity ? &base : nullptr;
}

Base& Bases::next() {
  if (kept_.empty()) {
    kept_.resize(kRememberedBases);
    for (Base& base : kept_) reserve(base, kUsualMembers);
    reserve(next_, kUsualMembers);
  }
  return next_;
}

void Bases::keep() noexcept {
  Base& slot = kept_[next_.identity.stamp % kRememberedBases];
  const bool again = slot.identity == next_.identity;
  next_.usable = !again || (slot.usable && same_contents(slot, next_));
  std::swap(slot, next_);
}

}  // namespace subworld
