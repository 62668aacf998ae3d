#pragma once

#include "wire/changes.hpp"
#include "wire/copy.hpp"

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <type_traits>
#include <vector>

/// The parts of frames and reports of which only the changes since a base travel (wire/changes). Each function has both
/// directions, as those of wire/convert, and notes in the delta what the reader has after the message.
namespace subworld {

/// The base that a received message refers to.
[[nodiscard]] inline MessageIdentity base_of(const msg::WorldFrame& w) noexcept {
  return {UserId{w.user()}, w.session(), 0, w.base_stamp()};
}
[[nodiscard]] inline MessageIdentity base_of(const msg::HapticReport& w) noexcept {
  return {UserId{w.user()}, w.session(), w.sender(), w.base_stamp()};
}

/// Which message is the base. On the way out the base is already known to be there.
bool base_fields(const auto& copy, auto& m, auto& w) {
  copy.delta.next->identity = identity_of(m);
  if constexpr (std::same_as<decltype(copy), const ToWire&>) {
    w.base_stamp() = copy.delta.base != nullptr ? copy.delta.base->identity.stamp : m.stamp;
  } else {
    m.base_stamp.reset();
    if (w.base_stamp() != w.stamp()) m.base_stamp = w.base_stamp();
  }
  return true;
}

/// A value that travels where it differs from `base`, and then sets `bit` of `mask`. `at` counts the elements of
/// `wire`. On the way in, the model gets the value of the base where there is none.
template <class Copy, class M, class Plain = std::remove_const_t<M>>
bool change(const Copy& copy, M& m, const Plain& base, std::uint8_t bit, auto& mask, auto& wire, std::size_t& at) {
  if constexpr (std::same_as<Copy, ToWire>) {
    if (same_bits(m, base)) return true;
    mask |= bit;
    copy(m, wire.emplace_back());
  } else {
    if ((mask & bit) == 0) {
      m = base;
    } else if (at == wire.size() || !copy(m, wire[at++])) {
      return false;
    }
  }
  return true;
}

/// A list that is omitted where it is as in the base.
bool list_fields(const auto& copy, auto& m, auto& w, auto in_base) {
  const Base* const base = copy.delta.base;
  if constexpr (std::same_as<decltype(copy), const ToWire&>) {
    w.as_in_base() = base != nullptr && m == base->*in_base;
    w.values().reserve(m.capacity());
    w.values().clear();
    if (!w.as_in_base()) copy(m, w.values());
  } else if (!w.as_in_base()) {
    if (!copy(m, w.values())) return false;
  } else {
    if (base == nullptr || !w.values().empty()) return false;
    m = base->*in_base;
  }
  copy.delta.next->*in_base = m;
  return true;
}

/// Ids of the elements of a list, which are omitted where they are as in the base.
template <class T>
bool id_fields(const auto& copy, T& m, auto& w, const auto* base, auto id) {
  if constexpr (std::same_as<decltype(copy), const ToWire&>) {
    w.as_in_base() = base != nullptr && std::ranges::equal(m, *base, {}, id, id);
    w.values().reserve(m.capacity());
    w.values().resize(w.as_in_base() ? 0 : m.size());
    for (std::size_t i = 0; i < w.values().size(); ++i) copy(m[i].*id, w.values()[i]);
  } else if (!w.as_in_base()) {
    m.resize(w.values().size());
    for (std::size_t i = 0; i < m.size(); ++i) copy(m[i].*id, w.values()[i]);
  } else {
    if (base == nullptr || !w.values().empty()) return false;
    m.resize(base->size());
    for (std::size_t i = 0; i < m.size(); ++i) m[i].*id = (*base)[i].*id;
  }
  return true;
}

/// Room for what one message can have at most, so that a loop does not allocate.
void begin_changes(const auto& copy, auto& wire, std::size_t most) {
  if constexpr (std::same_as<decltype(copy), const ToWire&>) {
    wire.reserve(most);
    wire.clear();
  }
}

/// The states of bodies. `omitted(i)`: whether that of m[i] is not sent.
bool state_fields(const auto& copy, auto& m, auto& w, auto omitted) {
  constexpr bool kOut = std::same_as<decltype(copy), const ToWire&>;
  const Base* const base = copy.delta.base;
  if (!id_fields(copy, m, w.bodies(), base != nullptr ? &base->states : nullptr, &StampedBody::id)) return false;
  begin_changes(copy, w.vectors(), 3 * m.capacity());
  begin_changes(copy, w.orientations(), m.capacity());
  if constexpr (kOut) {
    copy.resize(m, w.changed());
  } else if (w.changed().size() != m.size()) {
    return false;
  }
  std::vector<StampedBody>& next = copy.delta.next->states;
  next.resize(m.size());
  std::size_t vectors = 0, quaternions = 0;
  for (std::size_t i = 0; i < m.size(); ++i) {
    const BodyState before = base != nullptr ? state_of(*base, m[i].id) : BodyState{};
    next[i] = {m[i].id, before};
    auto& mask = w.changed()[i];
    if constexpr (kOut) {
      mask = 0;
      if (omitted(i)) continue;
    }
    auto& state = m[i].state;
    if (!change(copy, state.position, before.position, 1, mask, w.vectors(), vectors) ||
        !change(copy, state.orientation, before.orientation, 2, mask, w.orientations(), quaternions) ||
        !change(copy, state.linear_velocity, before.linear_velocity, 4, mask, w.vectors(), vectors) ||
        !change(copy, state.angular_velocity, before.angular_velocity, 8, mask, w.vectors(), vectors))
      return false;
    next[i].state = state;
  }
  return kOut || (vectors == w.vectors().size() && quaternions == w.orientations().size());
}
bool state_fields(const auto& copy, auto& m, auto& w) {
  return state_fields(copy, m, w, [](std::size_t) { return false; });
}

/// The bits of `Ghosts::kinds` above the number of axes.
struct GhostKind {
  static constexpr std::uint8_t kAxes = 3, kCarried = 4, kApproaching = 8, kMass = 16, kLoad = 32;
};

/// The model of a ghost but its axes. `before`: what the base has of it.
bool ghost_head_fields(const auto& copy, auto& m, const GhostModel& before, auto& kind, auto& w, std::size_t& numbers,
                       std::size_t& vectors) {
  if constexpr (std::same_as<decltype(copy), const ToWire&>) {
    kind = static_cast<std::uint8_t>(m.axis_count | (m.carried ? GhostKind::kCarried : 0) |
                                     (m.approaching ? GhostKind::kApproaching : 0));
    if (copy.delta.base != nullptr && !reads_load(m))
      return change(copy, m.mass_kg, before.mass_kg, GhostKind::kMass, kind, w.numbers(), numbers);
  } else {
    m.axis_count = kind & GhostKind::kAxes;
    m.approaching = (kind & GhostKind::kApproaching) != 0;
    copy.present(m.carried, (kind & GhostKind::kCarried) != 0);
  }
  return change(copy, m.mass_kg, before.mass_kg, GhostKind::kMass, kind, w.numbers(), numbers) &&
         change(copy, m.load_n, before.load_n, GhostKind::kLoad, kind, w.vectors(), vectors) &&
         copy.check(m.mass_kg > 0.0);
}

bool ghost_axis_fields(const auto& copy, auto& m, const GhostAxis& before, auto& mask, auto& w, std::size_t& numbers,
                       std::size_t& vectors) {
  return change(copy, m.normal, before.normal, 1, mask, w.vectors(), vectors) &&
         change(copy, m.force_n, before.force_n, 2, mask, w.numbers(), numbers) &&
         change(copy, m.coulomb_limit_n, before.coulomb_limit_n, 4, mask, w.numbers(), numbers) &&
         change(copy, m.load_dependent_friction, before.load_dependent_friction, 8, mask, w.vectors(), vectors) &&
         copy.check(m.coulomb_limit_n >= 0.0);
}

/// The ghosts of a frame, and its carried bodies, which always travel.
bool ghost_fields(const auto& copy, auto& ghosts, auto& frame) {
  constexpr bool kOut = std::same_as<decltype(copy), const ToWire&>;
  const Base* const base = copy.delta.base;
  auto& w = frame.ghosts();
  if (!id_fields(copy, ghosts, w.outside(), base != nullptr ? &base->ghosts : nullptr, &GhostModel::outside))
    return false;
  begin_changes(copy, w.changed_axes(), kMostGhostAxes * ghosts.capacity());
  begin_changes(copy, w.numbers(), (1 + 2 * kMostGhostAxes) * ghosts.capacity());
  begin_changes(copy, w.vectors(), (1 + 2 * kMostGhostAxes) * ghosts.capacity());
  begin_changes(copy, frame.carried_bodies(), ghosts.capacity());
  if constexpr (kOut) {
    copy.resize(ghosts, w.kinds());
  } else if (w.kinds().size() != ghosts.size()) {
    return false;
  }
  std::size_t axes = 0, numbers = 0, vectors = 0, carried = 0;
  for (std::size_t g = 0; g < ghosts.size(); ++g) {
    const GhostModel& before = base != nullptr ? ghost_of(*base, ghosts[g].outside) : kNoGhost;
    if (!ghost_head_fields(copy, ghosts[g], before, w.kinds()[g], w, numbers, vectors)) return false;
    for (std::size_t i = 0; i < ghosts[g].axis_count; ++i, ++axes) {
      if constexpr (kOut) {
        w.changed_axes().push_back(0);
      } else if (axes == w.changed_axes().size()) {
        return false;
      }
      const GhostAxis& axis = i < before.axis_count ? before.axes[i] : kNoAxis;
      if (!ghost_axis_fields(copy, ghosts[g].axes[i], axis, w.changed_axes()[axes], w, numbers, vectors)) return false;
    }
    if (!ghosts[g].carried) continue;
    if constexpr (kOut) {
      frame.carried_bodies().emplace_back();
    } else if (carried == frame.carried_bodies().size()) {
      return false;
    }
    if (!copy(*ghosts[g].carried, frame.carried_bodies()[carried++])) return false;
  }
  keep_ghosts(ghosts, base, *copy.delta.next);
  return kOut || (axes == w.changed_axes().size() && numbers == w.numbers().size() && vectors == w.vectors().size() &&
                  carried == frame.carried_bodies().size());
}

}  // namespace subworld
