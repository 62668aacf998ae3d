#include "haptic_sim/lockstep_order.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

void LockstepOrder::hear(std::size_t peer, const DeviceState& state) {
  Peer& of = peers_[peer];
  const double next_s = settings_.h_s * static_cast<double>(of.steps), half_s = 0.5 * settings_.h_s;
  const bool first = !of.heard_any, another = !first && state.sender != of.sender;
  if (is_replaced(peer, state) || (!another && state.stamp_s < next_s - of.period_s - half_s)) return;
  // A device that is slower than the haptic step sends a state again until it has another: states are counted.
  std::uint64_t step = of.steps;
  const bool later = state.stamp_s > next_s + half_s;
  if (later) miss(peer);
  if (later || another || first) step = static_cast<std::uint64_t>(std::llround(state.stamp_s / settings_.h_s));
  if (first && step < of.steps) return;  // of before the sub-world
  of.heard_any = true;
  of.sender = state.sender;
  const bool planned = misses(settings_.presence, static_cast<int>(user_), static_cast<int>(peer), time_of(step));
  if (planned || step < of.drops_before) {
    miss(peer);
    of.steps = step + 1;
    return;
  }
  if (of.misses || another) {
    of.misses = false;
    of.states = line_from(peer, step);
    of.from = step;
  }
  of.newest = &of.states.pass(state, step);
  of.steps = step + 1;
}

void LockstepOrder::note_missed(std::uint32_t peer) {
  const double from_s = settings_.h_s * static_cast<double>(step_),
               to_s = settings_.h_s * static_cast<double>(step_ + 1);
  const auto last = std::ranges::find(missed_.rbegin(), missed_.rend(), peer, &MissedStates::peer);
  if (last != missed_.rend() && last->to_s == from_s) {
    last->to_s = to_s;
  } else {
    missed_.push_back({peer, from_s, to_s});
  }
}

}  // namespace subworld
