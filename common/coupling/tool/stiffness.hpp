#pragma once

#include "model/scene/scene.hpp"

namespace subworld {

/// A device in a bare virtual wall: sampled, computed and held once a period.
struct SampledWall {
  double mass_kg = 0.1;             ///< m, of the device
  double damping_n_s_m = 0.5;       ///< b, of the device
  double period_s = 1e-3;           ///< T
  int delay = 0;                    ///< n, periods between a position and the force that answers it
  double wall_damping_n_s_m = 0.0;  ///< B, of the coupling
};

/// The largest stiffness K of a wall in which the device comes to rest, N/m; 0: none, its damping B alone is unstable.
///
/// Between samples the device follows m x'' = -b x' + F exactly, with the held force F_k = -(K x_{k-n} + B v_{k-n}).
/// With a = exp(-b T / m) and tau = m / b its transfer functions are
///   G_v(z) = (1 - a) / b / (z - a),                                                      (1)
///   G_x(z) = (tau (1 - a) G_v(z) + (T - tau (1 - a)) / b) / (z - 1).                       (2)
/// The loop is on the edge of stability where a root of z^n + K G_x + B G_v lies on the unit circle:
///   K = -(z^n + B G_v(z)) / G_x(z),  z = exp(i w),  and K real.                           (3)
/// The least such K is the answer. For n = 0 and B = 0 it is b (1 - a) / (tau (1 - a) - a T)
/// (Gil, Avello, Rubio, Florez 2004), close to 2 b / T for small T.
[[nodiscard]] double largest_stiffness(const SampledWall& wall);

/// Of a user's device and coupling, without the operator: as after a release.
[[nodiscard]] double largest_stiffness(const UserSpec& user, const Settings& settings);

}  // namespace subworld
