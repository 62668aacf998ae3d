#pragma once

#include "coupling/safety/energy_port.hpp"
#include "coupling/safety/force_guard.hpp"
#include "coupling/safety/motion_guard.hpp"
#include "coupling/safety/oscillation.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

namespace subworld {

/// Safety stage of the device between a received command and the operator: limits and fading
/// (coupling/safety/force_guard, coupling/safety/motion_guard), an observer of the energy exchanged with the operator,
/// and, unless the optimisation `energy_bound` leaves it out, a bound on that energy (coupling/safety/passivity).
class DeviceGuard {
 public:
  /// `fade_in_s`: time in which the force rises again after missing commands, s.
  DeviceGuard(const Scene& scene, std::size_t user, double fade_in_s);

  /// Call once per step of `dt` (s). Returns the command to apply until the next step. `now`: the device's state;
  /// `trusted`: the command is fresh.
  [[nodiscard]] DeviceCommand pass(const DeviceCommand& received, const DeviceState& now, bool trusted,
                                   double dt) noexcept;

  /// The force changes by little from step to step for a moment: another program forges commands.
  void soften() noexcept { force_.soften(); }

  [[nodiscard]] const OperatorPort& port() const noexcept { return port_; }
  [[nodiscard]] const OscillationWatch& oscillation() const noexcept { return oscillation_; }
  /// Share of the steps in which the energy was bounded.
  [[nodiscard]] double bounded_ratio() const noexcept { return steps_ > 0 ? double(bounded_) / double(steps_) : 0.0; }

 private:
  [[nodiscard]] Wrench passive(const Wrench& wanted, const DeviceState& now, double dt) noexcept;
  [[nodiscard]] DeviceMotion passive(DeviceMotion wanted, const DeviceState& now, double dt) noexcept;

  const UserSpec& user_;
  double proxy_mass_kg_;
  double proxy_inertia_kg_m2_;
  bool passive_;
  ForceGuard force_;
  MotionGuard motion_;
  DeviceMotion moved_;  ///< commanded motion after the bound, while it acts
  bool apart_ = false;  ///< moved_ differs from the commanded motion
  OperatorPort port_;
  OscillationWatch oscillation_;
  std::uint64_t steps_ = 0, bounded_ = 0;
};

}  // namespace subworld
