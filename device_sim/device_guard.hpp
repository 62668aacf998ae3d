#pragma once

#include "coupling/energy_port.hpp"
#include "coupling/force_guard.hpp"
#include "coupling/motion_guard.hpp"
#include "coupling/oscillation.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"

namespace subworld {

/// What stands between a received command and a hand, at the device: limits and fading (coupling/force_guard,
/// coupling/motion_guard), an observer of the energy at the hand, and, where `passive`, its bound (coupling/passivity).
class DeviceGuard {
 public:
  /// `fade_in_s`: in which a command counts again after it was missed.
  DeviceGuard(const UserSpec& user, const Body& proxy, bool passive, double fade_in_s);

  /// Once per step of `dt` seconds: what the device is to do until the next one. `now`: the device; `trusted`: the
  /// command is fresh.
  [[nodiscard]] DeviceCommand pass(const DeviceCommand& received, const DeviceState& now, bool trusted,
                                   double dt) noexcept;

  [[nodiscard]] const OperatorPort& port() const noexcept { return port_; }
  [[nodiscard]] const OscillationWatch& oscillation() const noexcept { return oscillation_; }
  /// Part of the steps in which the energy was bounded.
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
  DeviceMotion moved_;  ///< by the bound, where it acts
  bool apart_ = false;  ///< that motion is not yet the commanded one again
  OperatorPort port_;
  OscillationWatch oscillation_;
  std::uint64_t steps_ = 0, bounded_ = 0;
};

}  // namespace subworld
