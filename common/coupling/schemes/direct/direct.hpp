#pragma once

#include "coupling/schemes/scheme.hpp"

namespace subworld {

/// The baseline: no sub-world. Equation numbers are those of coupling/README.md.
/// The proxy lives in the world, which steps it with T = r h. A virtual coupling holds it to the device's newest pose;
/// the operator feels the force of that coupling against the world's last proxy state.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | x_W, v_W | m, m/s | position and velocity of the world's proxy |
/// | x_D, v_D | m, m/s | of the device, as its newest report has it |
/// | K, B | N/m, N s/m | the coupling's stiffness and damping |
///
///   F = K (x_D - x_W) + B (v_D - v_W),   implicit in the world's step (coupling/tool/virtual_coupling) (1)
///
/// The force of an admittance device acts on the world's proxy as it is. Error and stability are those of a coupling
/// that is sampled with T instead of h.
extern const Scheme kDirect;

}  // namespace subworld
