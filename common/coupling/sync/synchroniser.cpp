#include "coupling/sync/synchroniser.hpp"

#include "coupling/messages/delay.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// A share of the difference of two states, and another one of its rotation and angular velocity.
Shift part_of(const BodyState& from, const BodyState& to, double share, double turn_share) noexcept {
  if (share == 0.0 && turn_share == 0.0) return {};
  const Shift whole = difference(from, to);
  Shift part = scaled(whole, share);
  if (turn_share == share) return part;
  const Shift turn = scaled(whole, turn_share);
  part.rotation = turn.rotation;
  part.angular_velocity = turn.angular_velocity;
  return part;
}

}  // namespace

std::uint64_t remembered_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  const double unknown_s = settings.has_unknown_delay() ? kLongestRoundTrip_s : 0.0;
  return 16 + Delay(settings, scheme.properties.lead_cycles, 0).longest_cycles() +
         static_cast<std::uint64_t>(std::ceil(unknown_s / settings.shortest_cycle_s()));
}

std::uint64_t planned_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  return 3 + Delay(settings, scheme.properties.lead_cycles, 0).longest_cycles();
}

Synchroniser::Synchroniser(const Scheme& scheme, const Scene& scene, std::size_t user)
    : scheme_(&scheme),
      settings_(&scene.settings),
      authority_(scene.users[user].proxy, peers_of(scene, user)),
      enters_late_(scheme.properties.lead_cycles > 0 || settings_->delay.any() || settings_->has_unknown_delay()),
      tool_turns_(scene.users[user].device.degrees_of_freedom == 6),
      blends_(remembered_cycles(scene.settings, scheme)) {
  for (Blend& blend : blends_) blend.pairs.reserve(kUsualMembers);
  held_.reserve(kUsualMembers);
}

template <class Side>
BodyState Synchroniser::caught_up(BodyId id, BodyState state, std::uint64_t applied, std::uint64_t stamp,
                                  Side side) const {
  const std::uint64_t oldest = stamp > blends_.size() ? stamp - blends_.size() + 1 : 1;
  for (std::uint64_t j = std::max(applied + 1, oldest); j < stamp; ++j) {
    const Blend& blend = blends_[j % blends_.size()];
    if (blend.stamp != j) continue;
    const auto pair = find_sorted(blend.pairs, id, &PairShift::id);
    if (pair != blend.pairs.end()) state = shifted(state, side(*pair));
  }
  return state;
}

std::span<const PairShift> Synchroniser::synchronise(const WorldFrame& frame, const HapticReport& report,
                                                     double lag_cycles) {
  Blend& blend = blends_[frame.stamp % blends_.size()];
  blend.stamp = frame.stamp;
  blend.pairs.clear();
  authority_.compare(frame, report);
  const bool turns_alone = tool_turns_ && !authority_.has_peer(report);
  const double report_lag_cycles = static_cast<double>(report.stamp) - static_cast<double>(report.confirmed_stamp);
  for (const StampedBody& sub : report.members) {
    const auto world = find_sorted(frame.states, sub.id, &StampedBody::id);
    if (world == frame.states.end()) continue;
    const BodyState theirs = caught_up(sub.id, world->state, frame.echoed_stamp, frame.stamp,
                                       [](const PairShift& p) -> const Shift& { return p.world; });
    const BodyState ours = caught_up(sub.id, sub.state, report.confirmed_stamp, frame.stamp,
                                     [](const PairShift& p) -> const Shift& { return p.sub; });
    const CopyPair pair{authority_.owner(sub.id), lag_cycles, report_lag_cycles, turns_alone};
    Correction part = scheme_->correction(pair, report.indicators, *settings_);
    // The copy of a body that has entered since the start began with an older state of the world, at constant velocity.
    const bool entered = enters_late_ && !held_.empty() && !std::ranges::binary_search(held_, sub.id);
    if (entered && !pair.is_proxy()) part = {.world = 0.0, .sub = 1.0};
    blend.pairs.push_back(
        {sub.id, part_of(theirs, ours, part.world, part.world_turn), part_of(ours, theirs, part.sub, part.sub)});
  }
  held_.clear();
  for (const PairShift& pair : blend.pairs) held_.push_back(pair.id);
  return blend.pairs;
}

}  // namespace subworld
