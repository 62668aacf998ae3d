#include "coupling/synchroniser.hpp"

#include "coupling/delay.hpp"

#include <algorithm>

namespace subworld {

std::uint64_t remembered_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  return 16 + Delay(settings, scheme.properties.lead_cycles, 0).longest_cycles();
}

std::uint64_t planned_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  return 3 + Delay(settings, scheme.properties.lead_cycles, 0).longest_cycles();
}

Synchroniser::Synchroniser(const Scheme& scheme, const Scene& scene, std::size_t user)
    : scheme_(&scheme),
      settings_(&scene.settings),
      authority_(scene.users[user].proxy, peers_of(scene, user)),
      blends_(remembered_cycles(scene.settings, scheme)) {
  for (Blend& blend : blends_) blend.pairs.reserve(kUsualMembers);
}

template <class Side>
BodyState Synchroniser::caught_up(BodyId id, BodyState state, std::uint64_t applied, std::uint64_t stamp,
                                  Side side) const {
  const std::uint64_t oldest = stamp > blends_.size() ? stamp - blends_.size() + 1 : 1;
  for (std::uint64_t j = std::max(applied + 1, oldest); j < stamp; ++j) {
    const Blend& blend = blends_[j % blends_.size()];
    if (blend.stamp != j) continue;
    const auto pair = std::ranges::lower_bound(blend.pairs, id, {}, &PairShift::id);
    if (pair != blend.pairs.end() && pair->id == id) state = shifted(state, side(*pair));
  }
  return state;
}

std::span<const PairShift> Synchroniser::synchronise(const WorldFrame& frame, const HapticReport& report,
                                                     double lag_cycles) {
  Blend& blend = blends_[frame.stamp % blends_.size()];
  blend.stamp = frame.stamp;
  blend.pairs.clear();
  authority_.compare(frame, report);
  for (const StampedBody& sub : report.members) {
    const auto world = std::ranges::lower_bound(frame.states, sub.id, {}, &StampedBody::id);
    if (world == frame.states.end() || world->id != sub.id) continue;
    const BodyState theirs = caught_up(sub.id, world->state, frame.echoed_stamp, frame.stamp,
                                       [](const PairShift& p) -> const Shift& { return p.world; });
    const BodyState ours = caught_up(sub.id, sub.state, report.confirmed_stamp, frame.stamp,
                                     [](const PairShift& p) -> const Shift& { return p.sub; });
    const Correction correction =
        scheme_->correction({authority_.owner(sub.id), lag_cycles}, report.indicators, *settings_);
    const auto shift = [](const BodyState& from, const BodyState& to, double part) {
      return part > 0.0 ? scaled(difference(from, to), part) : Shift{};
    };
    blend.pairs.push_back({sub.id, shift(theirs, ours, correction.world), shift(ours, theirs, correction.sub)});
  }
  return blend.pairs;
}

}  // namespace subworld
