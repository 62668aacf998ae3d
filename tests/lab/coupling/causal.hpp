#pragma once

#include "lab/coupling/measure.hpp"

#include <optional>

namespace subworld {

/// The bound of causality: the error of an ideal coupling, which has no error of its own. Only the motion of the other
/// users' devices in the last d seconds is unknown to it.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | u, p | | a user; each other user |
/// | x_p | | pose and velocity of p's device in the reference; of an admittance device also the operator's force |
/// | d | s | one hop from p's device to u's sub-world (Direction::from_peer) |
/// | F_u | N | felt force of u |
///
/// For each user u the reference runs once more. u's own device is known at once, and that of p is continued:
///   x_p'(t) = forecast(x_p(t - d), d),  d at most kLongestGuess_s                                            (1)
///   causal error of u = RMS error of F_u in this run against the reference                                   (2)
/// The forecast is the product's (haptic_sim/peer_forecast), or that of constant velocity: the smaller error counts.
/// No run is needed where (1) is exact: without delay, for a single user, and beside devices at rest.
///
/// `scene` is that of the reference. Empty if a signal requested a stop.
[[nodiscard]] std::optional<CausalErrors> causal_errors_of(const Scene& scene, const DelaySettings& delay,
                                                           const Outcome& reference);

}  // namespace subworld
