#include "coupling/synchroniser.hpp"

#include <algorithm>

namespace subworld {

Synchroniser::Synchroniser(const Scheme& scheme, BodyId proxy, std::vector<BodyId> peers)
    : scheme_(&scheme), proxy_(proxy), peers_(std::move(peers)) {
  for (Blend& blend : blends_) blend.pairs.reserve(kUsualMembers);
}

template <class Side>
BodyState Synchroniser::caught_up(BodyId id, BodyState state, std::uint64_t applied, std::uint64_t stamp,
                                  Side side) const {
  const std::uint64_t oldest = stamp > kRememberedCycles ? stamp - kRememberedCycles + 1 : 1;
  for (std::uint64_t j = std::max(applied + 1, oldest); j < stamp; ++j) {
    const Blend& blend = blends_[j % kRememberedCycles];
    if (blend.stamp != j) continue;
    const auto pair =
        std::find_if(blend.pairs.begin(), blend.pairs.end(), [&](const PairShift& p) { return p.id == id; });
    if (pair != blend.pairs.end()) state = shifted(state, side(*pair));
  }
  return state;
}

std::span<const PairShift> Synchroniser::synchronise(const WorldFrame& frame, const HapticReport& report) {
  Blend& blend = blends_[frame.stamp % kRememberedCycles];
  blend.stamp = frame.stamp;
  blend.pairs.clear();
  for (const StampedBody& sub : report.members) {
    const auto world = std::lower_bound(frame.states.begin(), frame.states.end(), sub.id,
                                        [](const StampedBody& s, BodyId id) { return s.id < id; });
    if (world == frame.states.end() || world->id != sub.id) continue;
    const BodyState theirs = caught_up(sub.id, world->state, frame.echoed_stamp, frame.stamp,
                                       [](const PairShift& p) -> const Shift& { return p.world; });
    const BodyState ours = caught_up(sub.id, sub.state, report.confirmed_stamp, frame.stamp,
                                     [](const PairShift& p) -> const Shift& { return p.sub; });
    const bool peer = std::find(peers_.begin(), peers_.end(), sub.id) != peers_.end();
    const double s = peer ? 0.0 : scheme_->sub_weight(sub.id == proxy_, report.indicators);
    const BodyState one = subworld::blend(theirs, ours, s);
    blend.pairs.push_back({sub.id, difference(theirs, one), difference(ours, one)});
  }
  return blend.pairs;
}

}  // namespace subworld
