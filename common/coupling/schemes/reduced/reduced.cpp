#include "coupling/schemes/reduced/reduced.hpp"

#include "coupling/schemes/reduced/ghosts.hpp"
#include "coupling/sync/blend.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kLargestGain = 0.5;  ///< of (7)
constexpr double kDelayGain = 1.2;    ///< of (7), over the lag in cycles
/// Of (7b), cycles: without delay both copies meet halfway. What was tried: coupling/RESULTS.md.
constexpr double kFewestTurnCycles = 2.0;

/// The proxy between two reports, cubic in position; beyond the newest, at constant velocity for a while.
BodyState between(const HapticReport& before, const HapticReport& now, double t_s) noexcept {
  const double span = now.stamp_s - before.stamp_s;
  if (t_s >= now.stamp_s || span <= 0.0) return advanced(now.proxy, std::min(t_s - now.stamp_s, kLongestGuess_s));
  const double s = (t_s - before.stamp_s) / span;
  BodyState on_the_way = blend(before.proxy, now.proxy, s);
  on_the_way.position += s * (1.0 - s) *
                         ((1.0 - s) * (span * before.proxy.linear_velocity) - s * (span * now.proxy.linear_velocity) -
                          (1.0 - 2.0 * s) * (now.proxy.position - before.proxy.position));
  return on_the_way;
}

Correction reduced_correction(const CopyPair& pair, const Indicators&, const Settings&) noexcept {
  if (pair.owner == Owner::island) return {.world = 1.0, .sub = 0.0};
  return {.world = 0.0,
          .sub = std::min(kLargestGain, kDelayGain / std::max(1.0, pair.lag_cycles)),
          .world_turn = pair.turns_alone ? 1.0 / std::max(kFewestTurnCycles, pair.report_lag_cycles) : 0.0};
}

}  // namespace

ProxyDrive reduced_drive(const UserSpec& user, const Wrench& mean, const HapticReport& before, const HapticReport& now,
                         double until_s) {
  const BodyState proxy = between(before, now, until_s);
  return {mean, DevicePose{{proxy.position, proxy.orientation}, proxy.linear_velocity, proxy.angular_velocity},
          limits_of(user.device)};
}

constinit const Scheme kReduced{
    .properties = {.name = "reduced",
                   .summary = "impulses up, states down, the outside as ghosts: small errors, also with delay",
                   .simulates_border = true,
                   .replicates_peers = true,
                   .merges_shared_islands = true,
                   .corrects_gradually = true,
                   .lead_cycles = 1,
                   .longest_world_step_s = 0.005},
    .correction = reduced_correction,
    .make_world_side = make_reduced_world_side,
    .make_sub_world_side = [](const Scene& scene, std::uint64_t remembered_cycles) -> std::unique_ptr<SubWorldSide> {
      return std::make_unique<Ghosts>(scene, remembered_cycles);
    },
    .accepts = ghosts_fit};

}  // namespace subworld
