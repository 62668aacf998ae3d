#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"

namespace subworld {

/// A haptic device and what holds it.
///  * scripted: the device follows its path whatever it feels;
///  * hand, impedance device: arm and device move as one mass m = m_operator + m_device,
///      m a = K (x_path - x) + B (v_path - v) - b v - friction + force of the command                        (1)
///  * hand, admittance device: the device is servoed to the commanded pose and reports what the hand presses,
///      K (x_path - x) + B (v_path - v), within the force limit.
/// Positions are relative to where the device started.
///
/// The device works at its own rate: at each tick it reads its sensors, takes the newest command and holds it until the
/// next tick. Between two ticks translation follows (1) exactly: the matrix exponential of the system under a held
/// force, a path of constant velocity and a friction of constant direction, which stops what it would turn round. So
/// the largest stable stiffness is that of the sampled-data system (coupling/stiffness).
class EmulatedDevice {
 public:
  EmulatedDevice(const DeviceSpec& spec, std::uint32_t device);

  /// The device at its last tick.
  [[nodiscard]] const DeviceState& state() const noexcept { return state_; }
  /// Advances by dt (s); ticks on the way take the command. A command that is not finite counts as none.
  void step(const DeviceCommand& command, double dt) noexcept;

 private:
  /// Of one axis: displacement from the path's place at the start, velocity, the path's displacement, its velocity,
  /// held acceleration.
  using Motion = Eigen::Matrix<double, 5, 5>;

  void take(const DeviceCommand& command) noexcept;
  /// Without a tick on the way.
  void move(double dt) noexcept;
  void step_operator(double dt) noexcept;
  void turn_operator(double dt) noexcept;
  void follow_command(double dt) noexcept;
  void press() noexcept;
  void read_sensors() noexcept;
  [[nodiscard]] const Motion& motion(double dt) noexcept;

  DeviceSpec spec_;
  OperatorSpec operator_;
  double time_s_ = 0.0;
  std::uint64_t ticks_ = 0;
  bool command_due_ = true;  ///< at the tick that was just reached
  DeviceCommand held_;
  double motion_dt_ = 0.0;  ///< of `motion_`
  Motion motion_ = Motion::Identity();
  BodyState handle_;  ///< true state, before quantisation
  Vec3 read_velocity_ = Vec3::Zero();
  DeviceState state_;
};

}  // namespace subworld
