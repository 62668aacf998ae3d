#pragma once

#include "model/types.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Difference of a felt force F from its reference R; one entry per haptic step in both.
struct ForceError {
  double rms = 0.0;  ///< sqrt(sum |F - R|^2 / sum |R|^2)
  double p99 = 0.0;  ///< of |F - R|, over max |R|
  double max = 0.0;  ///< likewise
  /// Lag of F behind R with the least RMS; resolution one haptic step, refined by a parabola.
  double time_offset_s = 0.0;
  double value_offset = 0.0;  ///< RMS error at that lag
  double jitter_ratio = 0.0;  ///< noise_n of F over that of R
  double smoothed_rms = 0.0;  ///< `rms` of the centred 41-sample means
};

/// Forces of one user.
struct ForcePair {
  std::span<const Vec3> force;
  std::span<const Vec3> reference;
};

/// Over the common length of each user; the sums and the largest values go over all users, the lag is common to all.
/// Forces in N, h in s. Not finite where F is not.
[[nodiscard]] ForceError force_error(std::span<const ForcePair> users, double h_s);
/// Of one user.
[[nodiscard]] ForceError force_error(std::span<const Vec3> force, std::span<const Vec3> reference, double h_s);

/// RMS of the force minus its centred 41-sample mean, N: vibration that is faster than an operator's motion.
[[nodiscard]] double noise_n(std::span<const Vec3> force);

/// Centred mean over `window` samples (odd); fewer at the ends.
[[nodiscard]] std::vector<Vec3> smoothed(std::span<const Vec3> force, int window);

}  // namespace subworld
