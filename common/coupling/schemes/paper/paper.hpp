#pragma once

#include "coupling/schemes/scheme.hpp"

#include <span>
#include <vector>

namespace subworld {

/// The scheme of Glondu, Marchal and Dumont (2010), 4.1 to 4.3. World and sub-world simulate the same cycle at the same
/// time, then their copies are blended. Equation numbers are those of coupling/README.md.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | r | | simulation ratio T / h |
/// | lambda_n, lambda_t | N s | normal and tangential impulse of a border contact over a step of the world |
/// | x_W, x_S | | state of a body in the world and in the sub-world |
/// | I_p, I_s | N s | impulse magnitudes on the proxy, and in the whole sub-world, over a cycle |
/// | I_d | N s | impulse magnitude that the device exerted over a cycle |
/// | F | N | mean force of the device over the last cycle |
///
///   impulse on a border body in each haptic step = (lambda_n n + lambda_t) / r                               (3)
///   x = (1 - s) x_W + s x_S, at each synchronisation, for every pair of copies                               (4)
///   s = 1 without border bodies; else 0 without contacts on the proxy; else 0 if I_d is under a threshold;
///       else sqrt(I_p / I_s)                                                                                 (5)
///   s = 1 for the user's own proxy, 0 for another user's
///   F acts on the world's proxy during the next cycle (`device_force_in_world`; the paper does not say)
///
/// The order of the cases in (5) is the paper's: a closed sub-world has no drift to correct, and the world's coarser
/// copy would only add error.
extern const Scheme kPaper;

/// Equation (5): s, 0 .. 1.
[[nodiscard]] double blend_weight(const Indicators& indicators, const PaperSettings& settings) noexcept;

struct PointImpulse {
  BodyId body{};
  Vec3 impulse = Vec3::Zero();  ///< N s
  Vec3 point = Vec3::Zero();    ///< m
};

/// Equation (3). `fraction`: the part of a step of the world that a haptic step covers, 1 / r.
void frozen_impulses(std::span<const BoundaryContact> border, double fraction, std::vector<PointImpulse>& out);

}  // namespace subworld
