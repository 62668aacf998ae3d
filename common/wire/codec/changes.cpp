#include "wire/codec/changes.hpp"

#include "model/sorted.hpp"

#include <algorithm>
#include <cstring>
#include <functional>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

const GhostModel kNoGhost{};
const GhostAxis kNoAxis{.normal = Vec3::Zero()};

bool same_bits(double a, double b) noexcept { return std::memcmp(&a, &b, sizeof a) == 0; }
bool same_bits(const Vec3& a, const Vec3& b) noexcept {
  return std::memcmp(a.data(), b.data(), 3 * sizeof(double)) == 0;
}
bool same_bits(const Quat& a, const Quat& b) noexcept {
  return std::memcmp(a.coeffs().data(), b.coeffs().data(), 4 * sizeof(double)) == 0;
}

void reserve(Base& base, std::size_t bodies) {
  base.members.reserve(bodies);
  base.fixed.reserve(bodies);
  base.islands.reserve(bodies);
  base.states.reserve(bodies);
  base.ghosts.reserve(bodies);
}

/// At rest in the origin if there is no base, or if it does not have the body.
BodyState state_of(const Base* base, BodyId id) noexcept {
  if (base == nullptr) return {};
  const auto at = find_sorted(base->states, id, &StampedBody::id);
  return at != base->states.end() ? at->state : BodyState{};
}
const GhostModel& ghost_of(const Base* base, BodyId id) noexcept {
  if (base == nullptr) return kNoGhost;
  const auto at = find_sorted(base->ghosts, id, &GhostModel::outside);
  return at != base->ghosts.end() ? *at : kNoGhost;
}

/// Whether the world overrules a member's state, so that it is not sent.
bool is_overruled(const HapticReport& report, std::size_t member) noexcept {
  return report.omits_overruled && member < report.islands.size() && report.islands[member] == kOpenIsland;
}
/// Whether the motion of a ghost depends on the load in its model.
bool reads_load(const GhostModel& ghost) noexcept {
  for (std::size_t i = 0; i < ghost.axis_count; ++i) {
    if (!ghost.axes[i].load_dependent_friction.isZero(0.0)) return true;
  }
  return false;
}
/// Notes the ghosts of a message. A load that was not sent is that of the base.
void keep_ghosts(const std::vector<GhostModel>& ghosts, Delta delta) {
  delta.next->ghosts = ghosts;
  if (delta.base == nullptr) return;
  for (GhostModel& ghost : delta.next->ghosts) {
    if (!reads_load(ghost)) ghost.load_n = ghost_of(delta.base, ghost.outside).load_n;
  }
}

/// Empty, with room for what one message can have at most, so that a loop does not allocate.
template <class T>
std::vector<T>& emptied(std::vector<T>& sent, std::size_t most) {
  sent.reserve(most);
  sent.clear();
  return sent;
}

/// Values that travel where they differ from those of the base, on their way out. Each then sets a bit of a mask.
template <class T>
class Outgoing {
 public:
  Outgoing(std::vector<T>& sent, std::size_t most) : sent_(emptied(sent, most)) {}
  bool operator()(const T& m, const T& base, std::uint8_t bit, std::uint8_t& mask) {
    if (same_bits(m, base)) return true;
    mask |= bit;
    sent_.push_back(m);
    return true;
  }

 private:
  std::vector<T>& sent_;
};
/// On their way in. The message gets the value of the base where there is none. False where one is missing.
template <class T>
class Incoming {
 public:
  explicit Incoming(const std::vector<T>& sent) : sent_(sent) {}
  bool operator()(T& m, const T& base, std::uint8_t bit, std::uint8_t mask) {
    if ((mask & bit) != 0 && at_ == sent_.size()) return false;
    m = (mask & bit) != 0 ? sent_[at_++] : base;
    return true;
  }
  [[nodiscard]] bool all_taken() const { return at_ == sent_.size(); }

 private:
  const std::vector<T>& sent_;
  std::size_t at_ = 0;
};

bool change_state(auto& m, const BodyState& base, auto& mask, auto& vectors, auto& orientations) {
  return vectors(m.position, base.position, 1, mask) && orientations(m.orientation, base.orientation, 2, mask) &&
         vectors(m.linear_velocity, base.linear_velocity, 4, mask) &&
         vectors(m.angular_velocity, base.angular_velocity, 8, mask);
}
bool change_axis(auto& m, const GhostAxis& base, auto& mask, auto& numbers, auto& vectors) {
  return vectors(m.normal, base.normal, 1, mask) && numbers(m.force_n, base.force_n, 2, mask) &&
         numbers(m.coulomb_limit_n, base.coulomb_limit_n, 4, mask) &&
         vectors(m.load_dependent_friction, base.load_dependent_friction, 8, mask);
}
/// The bits of `Ghosts::kinds` above the number of axes.
struct GhostKind {
  static constexpr std::uint8_t kAxes = 3, kCarried = 4, kApproaching = 8, kMass = 16, kLoad = 32;
};

/// `id_of`: what travels of each element.
template <class T>
void pack_list(const auto& m, const auto* base, ListChanges<T>& sent, auto id_of) {
  sent.as_in_base = base != nullptr && std::ranges::equal(m, *base, {}, id_of, id_of);
  emptied(sent.values, m.capacity());
  if (!sent.as_in_base) std::ranges::transform(m, std::back_inserter(sent.values), id_of);
}
template <class T>
bool unpack_list(const ListChanges<T>& sent, const auto* base, auto& m, auto id_of) {
  if (sent.as_in_base && (base == nullptr || !sent.values.empty())) return false;
  m.resize(sent.as_in_base ? base->size() : sent.values.size());
  for (std::size_t i = 0; i < m.size(); ++i)
    std::invoke(id_of, m[i]) = sent.as_in_base ? std::invoke(id_of, (*base)[i]) : sent.values[i];
  return true;
}
template <class T>
const T* part_of(const Base* base, T Base::*part) {
  return base != nullptr ? &(base->*part) : nullptr;
}

template <class T>
void pack_list(const std::vector<T>& m, std::vector<T> Base::*part, Delta delta, ListChanges<T>& sent) {
  pack_list(m, part_of(delta.base, part), sent, std::identity{});
  delta.next->*part = m;
}
template <class T>
bool unpack_list(const ListChanges<T>& sent, std::vector<T> Base::*part, Delta delta, std::vector<T>& m) {
  if (!unpack_list(sent, part_of(delta.base, part), m, std::identity{})) return false;
  delta.next->*part = m;
  return true;
}

/// `omitted(i)`: whether the state of m[i] is not sent.
void pack_states(const std::vector<StampedBody>& m, Delta delta, StateChanges& sent, auto omitted) {
  pack_list(m, part_of(delta.base, &Base::states), sent.bodies, &StampedBody::id);
  Outgoing vectors(sent.vectors, 3 * m.capacity());
  Outgoing orientations(sent.orientations, m.capacity());
  emptied(sent.changed, m.capacity());
  std::vector<StampedBody>& next = delta.next->states;
  next.resize(m.size());
  for (std::size_t i = 0; i < m.size(); ++i) {
    const BodyState before = state_of(delta.base, m[i].id);
    std::uint8_t mask = 0;
    if (!omitted(i)) change_state(m[i].state, before, mask, vectors, orientations);
    next[i] = {m[i].id, omitted(i) ? before : m[i].state};
    sent.changed.push_back(mask);
  }
}
bool unpack_states(const StateChanges& sent, Delta delta, std::vector<StampedBody>& m) {
  if (!unpack_list(sent.bodies, part_of(delta.base, &Base::states), m, &StampedBody::id) ||
      sent.changed.size() != m.size())
    return false;
  Incoming vectors(sent.vectors);
  Incoming orientations(sent.orientations);
  for (std::size_t i = 0; i < m.size(); ++i) {
    if (!change_state(m[i].state, state_of(delta.base, m[i].id), sent.changed[i], vectors, orientations)) return false;
  }
  delta.next->states = m;
  return vectors.all_taken() && orientations.all_taken();
}

void pack_ghosts(const std::vector<GhostModel>& ghosts, Delta delta, Changes& changes) {
  GhostChanges& sent = changes.ghosts;
  pack_list(ghosts, part_of(delta.base, &Base::ghosts), sent.outside, &GhostModel::outside);
  Outgoing numbers(sent.numbers, (1 + 2 * kMostGhostAxes) * ghosts.capacity());
  Outgoing vectors(sent.vectors, (1 + 2 * kMostGhostAxes) * ghosts.capacity());
  emptied(sent.kinds, ghosts.capacity());
  emptied(sent.changed_axes, kMostGhostAxes * ghosts.capacity());
  emptied(changes.carried, ghosts.capacity());
  for (const GhostModel& ghost : ghosts) {
    const GhostModel& before = ghost_of(delta.base, ghost.outside);
    auto kind = static_cast<std::uint8_t>(ghost.axis_count | (ghost.carried ? GhostKind::kCarried : 0) |
                                          (ghost.approaching ? GhostKind::kApproaching : 0));
    numbers(ghost.mass_kg, before.mass_kg, GhostKind::kMass, kind);
    if (delta.base == nullptr || reads_load(ghost)) vectors(ghost.load_n, before.load_n, GhostKind::kLoad, kind);
    sent.kinds.push_back(kind);
    for (std::size_t i = 0; i < ghost.axis_count; ++i) {
      std::uint8_t mask = 0;
      change_axis(ghost.axes[i], i < before.axis_count ? before.axes[i] : kNoAxis, mask, numbers, vectors);
      sent.changed_axes.push_back(mask);
    }
    if (ghost.carried) changes.carried.push_back(*ghost.carried);
  }
  keep_ghosts(ghosts, delta);
}
bool unpack_ghosts(const Changes& changes, Delta delta, std::vector<GhostModel>& ghosts) {
  const GhostChanges& sent = changes.ghosts;
  if (!unpack_list(sent.outside, part_of(delta.base, &Base::ghosts), ghosts, &GhostModel::outside) ||
      sent.kinds.size() != ghosts.size())
    return false;
  Incoming numbers(sent.numbers);
  Incoming vectors(sent.vectors);
  std::size_t axes = 0, carried = 0;
  for (std::size_t g = 0; g < ghosts.size(); ++g) {
    GhostModel& ghost = ghosts[g];
    const GhostModel& before = ghost_of(delta.base, ghost.outside);
    const std::uint8_t kind = sent.kinds[g];
    ghost.axis_count = kind & GhostKind::kAxes;
    ghost.approaching = (kind & GhostKind::kApproaching) != 0;
    if (!numbers(ghost.mass_kg, before.mass_kg, GhostKind::kMass, kind) || !(ghost.mass_kg > 0.0) ||
        !vectors(ghost.load_n, before.load_n, GhostKind::kLoad, kind))
      return false;
    for (std::size_t i = 0; i < ghost.axis_count; ++i, ++axes) {
      if (axes == sent.changed_axes.size()) return false;
      GhostAxis& axis = ghost.axes[i];
      const GhostAxis& axis_before = i < before.axis_count ? before.axes[i] : kNoAxis;
      if (!change_axis(axis, axis_before, sent.changed_axes[axes], numbers, vectors) || axis.coulomb_limit_n < 0.0)
        return false;
    }
    ghost.carried.reset();
    if ((kind & GhostKind::kCarried) == 0) continue;
    if (carried == changes.carried.size()) return false;
    ghost.carried = changes.carried[carried++];
  }
  keep_ghosts(ghosts, delta);
  return axes == sent.changed_axes.size() && numbers.all_taken() && vectors.all_taken() &&
         carried == changes.carried.size();
}

void pack_base(const auto& message, Delta delta, Changes& changes) {
  delta.next->identity = identity_of(message);
  changes.base_stamp = delta.base != nullptr ? delta.base->identity.stamp : message.stamp;
}
void unpack_base(const Changes& changes, Delta delta, auto& message) {
  delta.next->identity = identity_of(message);
  message.base_stamp.reset();
  if (changes.base_stamp != message.stamp) message.base_stamp = changes.base_stamp;
}

}  // namespace

void pack(const WorldFrame& frame, Delta delta, Changes& changes) {
  pack_base(frame, delta, changes);
  pack_list(frame.members, &Base::members, delta, changes.members);
  pack_list(frame.fixed, &Base::fixed, delta, changes.fixed);
  pack_list(frame.islands, &Base::islands, delta, changes.islands);
  pack_states(frame.states, delta, changes.states, [](std::size_t) { return false; });
  pack_ghosts(frame.ghosts, delta, changes);
}
bool unpack(const Changes& changes, Delta delta, WorldFrame& frame) {
  unpack_base(changes, delta, frame);
  return unpack_list(changes.members, &Base::members, delta, frame.members) &&
         unpack_list(changes.fixed, &Base::fixed, delta, frame.fixed) &&
         unpack_list(changes.islands, &Base::islands, delta, frame.islands) &&
         unpack_states(changes.states, delta, frame.states) && unpack_ghosts(changes, delta, frame.ghosts);
}

void pack(const HapticReport& report, Delta delta, Changes& changes) {
  pack_base(report, delta, changes);
  pack_states(report.members, delta, changes.states, [&](std::size_t i) { return is_overruled(report, i); });
  pack_list(report.islands, &Base::islands, delta, changes.islands);
}
bool unpack(const Changes& changes, Delta delta, HapticReport& report) {
  unpack_base(changes, delta, report);
  return unpack_states(changes.states, delta, report.members) &&
         unpack_list(changes.islands, &Base::islands, delta, report.islands);
}

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
  next_.usable = slot.identity != next_.identity;
  std::swap(slot, next_);
}

}  // namespace subworld
