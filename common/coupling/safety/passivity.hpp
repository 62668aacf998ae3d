#pragma once

#include "coupling/safety/energy_port.hpp"
#include "model/scene/scene.hpp"

namespace subworld {

/// Makes a device passive whatever is behind it, by the energy that its operator has put in
/// (coupling/safety/energy_port).
///
/// | symbol | unit | is |
/// |---|---|---|
/// | E | J | level of the port: what the operator has put in and not got back, at most what the coupling can store |
/// | F, F_h | N | wanted force on the operator; force of the operator on the device |
/// | v | m/s | velocity of the device |
/// | K | N/m | stiffness of the virtual coupling |
/// | m | kg | mass of the proxy |
/// | dt | s | haptic step |
///
/// A spring that pushes with F has stored F^2 / 2K, and a mass that moves with v has stored m v^2 / 2. So an impedance
/// device pushes along with the motion with at most
///   |F| <= sqrt(2 K E),                                                  (1)
/// and an admittance device, which its operator pushes with F_h along v, moves with at most
///   |v| <= sqrt(2 E / m) + max(0, F_h) dt / m.                           (2)
/// A force that brakes the motion takes energy and is free; between the two the bound is blended linearly over
/// kBlend_m_s of velocity, so that the force is smooth where the motion turns back. Bound (1) follows the motion as the
/// spring itself would, by dF = K dx, and (2) as the mass would: neither chatters.
///
/// Sources: passivity in the time domain with an observer of the energy at the port (Hannaford and Ryu 2002); energy
/// tanks that bound what may be spent (Franken, Stramigioli, Misra, Secchi, Macchelli 2011). The observer and damper of
/// the first was tried: on an empty port it cuts the force at the first motion along it and lets it return when that
/// stops.
[[nodiscard]] Vec3 passive_force(const Vec3& wanted_n, const Vec3& velocity_m_s, double stored_j, double stiffness_n_m,
                                 double dt) noexcept;
[[nodiscard]] Vec3 passive_velocity(const Vec3& wanted_m_s, const Vec3& operator_n, double stored_j, double mass_kg,
                                    double dt) noexcept;

inline constexpr double kBlend_m_s = 0.01;

}  // namespace subworld
