#pragma once

#include "device_sim/device.hpp"
#include "model/scene/scene.hpp"

#include <optional>

namespace subworld {

/// An emulated haptic device with an emulated operator. There are three cases.
///   * Scripted: the device follows its path, whatever the force.
///   * Impedance device with operator: arm and device move as one mass m = m_operator + m_device,
///       m a = K (x_path - x) + B (v_path - v) - b v - friction + force of the command                        (1)
///   * Admittance device with operator: the device is servoed to the commanded pose and reports the operator's force,
///       K (x_path - x) + B (v_path - v), within the force limit.
/// An operator with a tremor of amplitude A and frequency w also exerts the force that moves the free arm so:
///   A |K - m w^2 + i w (B + b)| sin(w t + phase)                                                             (2)
/// in a direction and with a phase that are drawn from the device's number.
/// Positions are relative to the device's start.
///
/// The device works at its own rate. At each tick it reads its sensors, takes the newest command and holds it until the
/// next tick. Between two ticks the translation follows (1) exactly: by the matrix exponential of the system under a
/// held force, with a path of constant velocity. Friction has a constant direction and stops a motion that it would
/// reverse. So the largest stable stiffness is that of the sampled-data system (coupling/tool/stiffness).
class EmulatedDevice final : public Device {
 public:
  EmulatedDevice(const DeviceSpec& spec, std::uint32_t device);

  /// The device at its last tick.
  [[nodiscard]] const DeviceState& state() const noexcept override { return state_; }
  /// Advances by dt (s). Ticks within dt take the command. A command that is not finite is ignored.
  void step(const DeviceCommand& command, double dt) noexcept override;
  /// The operator comes back in the middle of a run: the path goes on from that time, s, at the device's place.
  void resume_at(double time_s) noexcept override;

 private:
  /// State of one axis: displacement from the path's start, velocity, the path's displacement, its velocity, held
  /// acceleration.
  using Motion = Eigen::Matrix<double, 5, 5>;

  void begin_tremor(std::uint32_t device) noexcept;
  /// (2), N.
  [[nodiscard]] Vec3 tremor(double time_s) const noexcept;
  /// Where the operator wants the device.
  [[nodiscard]] PathPoint path(double time_s) const noexcept;
  void take(const DeviceCommand& command) noexcept;
  /// Advances by dt (s) without a tick in between.
  void move(double dt) noexcept;
  void step_operator(double dt) noexcept;
  void turn_operator(double dt) noexcept;
  void follow_command(double dt) noexcept;
  void press() noexcept;
  void read_sensors() noexcept;
  [[nodiscard]] const Motion& motion(double dt) noexcept;

  DeviceSpec spec_;
  OperatorSpec operator_;
  Vec3 tremor_n_ = Vec3::Zero();  ///< largest force of (2)
  double tremor_phase_rad_ = 0.0;
  double time_s_ = 0.0;
  std::optional<Pose> resumed_;  ///< of the path's start, for one that has been resumed
  std::uint64_t ticks_ = 0;
  bool command_due_ = true;  ///< a tick was just reached
  DeviceCommand held_;
  double motion_dt_ = 0.0;  ///< the dt for which motion_ was computed
  Motion motion_ = Motion::Identity();
  BodyState handle_;  ///< true state, before quantisation
  Vec3 read_velocity_ = Vec3::Zero();
  DeviceState state_;
};

}  // namespace subworld
