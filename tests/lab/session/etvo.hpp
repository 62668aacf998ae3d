#pragma once

#include "model/types.hpp"

#include <span>

namespace subworld {

/// Effective time and value offset of a felt force F against its reference R (ETVO: Kroep, Gokhale, Verburg,
/// Venkatesha Prasad 2021, arXiv 2107.05343). Dynamic time warping within a band (Sakoe, Chiba 1978) finds for each
/// instant of F the instant of R that it renders. What is left in between are a delay and a difference of force.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | F_i, R_j | N | samples at kSample_s, or at the haptic step where that is longer |
/// | b | | half width of the band, kBand_s |
/// | w | N | cost of a step that warps, kWarp max |R|: noise must not be explained by delays |
/// | (i, j) | | a pair of the path with the least D(n, n) |
///
///   D(i, j) = |F_i - R_j| + min(D(i-1, j-1), D(i-1, j) + w, D(i, j-1) + w),  |i - j| <= b                     (1)
///   time offset |i - j| kSample_s,  value offset |F_i - R_j|                                                 (2)
///
/// (2) is taken over the pairs in which a force is felt, of at least kFelt max |R|. The source refines (1) in other
/// ways, so figures are not comparable with its own.
struct Etvo {
  double time_p50_s = 0.0, time_p99_s = 0.0;
  double value_p50_n = 0.0, value_p99_n = 0.0;
};
/// Over the common length. Not numbers where the reference has no force.
[[nodiscard]] Etvo etvo(std::span<const Vec3> force, std::span<const Vec3> reference, double h_s);

}  // namespace subworld
