#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"

namespace subworld {

/// A haptic device and what holds it.
///  * scripted: the device follows its path whatever it feels;
///  * hand, impedance device: arm and device move as one mass m = m_hand + m_device,
///      m a = K (x_path - x) + B (v_path - v) - b v - friction + force of the command;
///  * hand, admittance device: the device is servoed to the commanded pose and reports what the hand presses,
///      K (x_path - x) + B (v_path - v), within the force limit.
/// Positions are relative to where the device started.
class EmulatedDevice {
 public:
  EmulatedDevice(const DeviceSpec& spec, std::uint32_t device);

  /// The device at the present time.
  [[nodiscard]] const DeviceState& state() const noexcept { return state_; }
  /// Advances by dt (s) under the newest command. A command that is not finite counts as none.
  void step(const DeviceCommand& command, double dt) noexcept;

 private:
  void step_hand(const Wrench& command, double dt) noexcept;
  void follow_command(const DeviceCommand& command, double dt) noexcept;
  void press(double time_s) noexcept;
  void publish() noexcept;

  DeviceSpec spec_;
  HandSpec hand_;
  double time_s_ = 0.0;
  BodyState handle_;  ///< true state, before quantisation
  Vec3 read_velocity_ = Vec3::Zero();
  DeviceState state_;
};

}  // namespace subworld
