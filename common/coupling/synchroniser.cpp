#include "coupling/synchroniser.hpp"

#include "coupling/delay.hpp"

#include <algorithm>

namespace subworld {

std::uint64_t remembered_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  return 16 + Delay(settings, scheme.lead_cycles(), 0).longest_cycles();
}

std::uint64_t planned_cycles(const Settings& settings, const Scheme& scheme) noexcept {
  return 3 + Delay(settings, scheme.lead_cycles(), 0).longest_cycles();
}

Synchroniser::Synchroniser(const Scheme& scheme, std::uint64_t remembered_cycles, BodyId proxy,
                           std::vector<BodyId> peers)
    : scheme_(&scheme), proxy_(proxy), peers_(std::move(peers)), blends_(remembered_cycles) {
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
  const bool islands = !frame.islands.empty();
  if (islands) {
    islands_.begin(frame.members);
    islands_.join(frame.members, frame.islands);
    for (const StampedBody& sub : report.members) reported_.push_back(sub.id);
    islands_.join(reported_, report.islands);
    reported_.clear();
  }
  for (const StampedBody& sub : report.members) {
    const auto world = std::ranges::lower_bound(frame.states, sub.id, {}, &StampedBody::id);
    if (world == frame.states.end() || world->id != sub.id) continue;
    const BodyState theirs = caught_up(sub.id, world->state, frame.echoed_stamp, frame.stamp,
                                       [](const PairShift& p) -> const Shift& { return p.world; });
    const BodyState ours = caught_up(sub.id, sub.state, report.confirmed_stamp, frame.stamp,
                                     [](const PairShift& p) -> const Shift& { return p.sub; });
    const CopyPair copies{.proxy = sub.id == proxy_,
                          .peer = std::ranges::find(peers_, sub.id) != peers_.end(),
                          .closed = islands && !islands_.is_open(sub.id),
                          .lag_cycles = lag_cycles};
    const Correction part = scheme_->correction(copies, report.indicators);
    const auto shift = [](const BodyState& from, const BodyState& to, double part) {
      return part > 0.0 ? scaled(difference(from, to), part) : Shift{};
    };
    blend.pairs.push_back({sub.id, shift(theirs, ours, part.world), shift(ours, theirs, part.sub)});
  }
  return blend.pairs;
}

}  // namespace subworld
