#pragma once

#include "coupling/schemes/scheme.hpp"

namespace subworld {

/// The default scheme: impulses up, time-stamped states down, the outside as ghosts. Equation numbers are those of
/// coupling/README.md.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | h, T | s | haptic step, cycle of the world |
/// | q | | extra delay of a frame, in haptic steps |
/// | J_j | N s | impulse that the user exerted on the proxy in cycle j |
/// | F | N | its mean force over the cycle |
/// | W_j, S_j | | state of a body at stamp j in the world and in the sub-world |
/// | a | | gain of a correction |
/// | R_W, R_S | | orientations of a body in W_j and S_j; angular velocities likewise |
/// | b, d | 1, cycles | the world's share of a turn; age of the newest frame that S_j knows of |
///
///   J_j = sum of F_i h,  F = J_j / T                                                                         (6)
///   e = W_j - S_j,  x <- x + a e,  a = min(1/2, 1.2 r / (r + q))                                             (7)
///   R_W <- R_W + b (R_S - R_W),  b = 1 / max(2, d) or 0                                                      (7b)
///
/// Up: the world simulates a cycle when it has the sub-world's report of it (lead_cycles = 1). F acts on the world's
/// proxy, and an implicit spring draws the proxy to where the sub-world's was at the same time; where the two agree, F
/// alone acts. Down: a closed island is the sub-world's (authority.hpp); of any other difference the part a goes into
/// the sub-world. A larger gain would drag the sub-world ahead of itself under delay. With a tool of six degrees of
/// freedom, rotations are corrected on both sides: a body that friction holds creeps, in each engine step by a part of
/// what loads it, and so turns faster in the world's longer step than in the sub-world's. Corrected on one side, both
/// copies would creep as the world's does. b is 0 for other tools, and where another user's proxy is inside.
///
/// | file | holds |
/// |---|---|
/// | reduced.cpp | (6), (7) and the properties |
/// | world_side.cpp | the border of a frame: contacts, approaching bodies, ghost models, islands |
/// | approach.hpp | bodies that may touch the sub-world before its next frame |
/// | ghost_model.hpp | effective mass, driving force and friction limit of a ghost, (9) to (14) |
/// | carried.hpp, rolling.hpp | ghosts that only the inside holds, (15); bodies that roll |
/// | ghosts.hpp | the ghosts in the sub-world's engine |
extern const Scheme kReduced;

/// The world's side; `drive` is in reduced.cpp.
[[nodiscard]] std::unique_ptr<WorldSide> make_reduced_world_side(const Scene& scene);
/// Equation (6), and the spring to the sub-world's proxy at `until_s`.
[[nodiscard]] ProxyDrive reduced_drive(const UserSpec& user, const Wrench& mean, const HapticReport& before,
                                       const HapticReport& now, double until_s);

}  // namespace subworld
