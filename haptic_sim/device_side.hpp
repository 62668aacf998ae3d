#pragma once

#include "coupling/safety/energy_port.hpp"
#include "coupling/safety/force_guard.hpp"
#include "coupling/safety/motion_guard.hpp"
#include "coupling/tool/tool.hpp"
#include "haptic_sim/declutch.hpp"
#include "haptic_sim/local_model.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <optional>
#include <span>

namespace subworld {

/// What one haptic step brought.
struct FeltStep {
  Wrench felt;         ///< on the proxy, by the coupling at the start of the step
  Wrench to_operator;  ///< for the device: bounded, finite, ramped
};

/// What one haptic step needs.
struct StepInput {
  const DeviceState* device = nullptr;  ///< null: none has been received yet, and no force is felt
  bool device_trusted = true;           ///< its state is fresh
  /// By user, the newest state of the device of each whose proxy is in the sub-world (`SubWorldFacts::peers`); null:
  /// none has come, and the world's account of it counts.
  std::span<const DeviceState* const> peers = {};
  double wall_s = 0.0;  ///< since the step before
  double dt = 0.0;      ///< simulated time that the step covers
  /// Rate of the clock, simulated seconds per second (coupling/tool/tool). A clock that stands, 0, changes nothing: the
  /// tool goes on from the rate that it had.
  double clock_rate = 1.0;
  double took_s = 0.0;  ///< time that the step before took, by the caller's clock; 0: not known
  /// While the sub-world is paused the force fades to zero, and the device may move without moving the proxy. On resume
  /// the coupling restarts at the device's new position.
  bool paused = false;
  /// The loop slept for so long that the device has let the force fade: it rises from zero.
  bool slept = false;
  /// The device is another one, or was away: from now on it is where it was in the scene, and the force rises from
  /// zero.
  bool device_returned = false;
};

/// The device of a sub-world: where it is in the scene, how the coupling pulls, and what its operator gets.
class DeviceSide {
 public:
  DeviceSide(const Scene& scene, std::size_t user);

  /// A step begins. Returns the rate of the clock in the step before where it differs.
  std::optional<double> begin(const StepInput& input) noexcept;
  /// The force of the step, with the proxy there, which is `sound`, finite, or not.
  [[nodiscard]] FeltStep feel(const StepInput& input, const BodyState& proxy, bool sound, const OthersEnergy& others);
  /// How the user acts on the proxy until the step's end.
  [[nodiscard]] Drive drive(std::span<const DeviceState* const> peers) const noexcept;
  /// The step of `dt` s of simulated time has ended with the proxy there. Returns the work of the mean wrench, J.
  double advance(const Wrench& mean, const BodyState& proxy, double dt) noexcept;
  /// For a moment the force changes by little from step to step.
  void soften() noexcept { guard_.soften(); }
  /// The sub-world starts anew: puts the device where the coupling has the stretch with which the world holds the
  /// proxy, or else the one that it had with the proxy `before`, null: it stays where it is.
  void restart(const WorldFrame& frame, const BodyState* before, const BodyState& proxy, bool sound) noexcept;

  /// See SubWorld.
  [[nodiscard]] DeviceCommand command_for(const DeviceState& device, const Wrench& to_operator, const BodyState& proxy);
  /// Adds the rate, the energies and, where it is wanted, the device.
  void describe(HapticReport& report) const;

  [[nodiscard]] const DevicePose& pose() const noexcept { return declutch_.device(); }  ///< in simulated time
  [[nodiscard]] double stamp_s() const noexcept { return before_.stamp_s; }  ///< of the state in the newest step
  [[nodiscard]] double rate() const noexcept { return tool_.rate(); }
  /// Device states that no operator can have reached since the one before.
  [[nodiscard]] std::uint64_t jumps() const noexcept { return jumps_; }
  /// The energy that crossed between the operator and this side of the device's link.
  [[nodiscard]] const OperatorPort& port() const noexcept { return port_; }

 private:
  /// Whether the device moved farther since the state before than an operator can move it.
  [[nodiscard]] bool jumped(const DeviceState& state, double wall_s) const noexcept;
  /// The coupling is a spring, whose other end moves with the device; an admittance device presses the proxy itself.
  [[nodiscard]] bool spring() const noexcept { return spec_.device.kind == DeviceKind::impedance; }

  const UserSpec& spec_;
  ForceLimits limits_;
  ForceGuard guard_;
  MotionGuard motion_;
  OperatorPort port_;
  RatedTool tool_;
  Declutch declutch_;
  DeviceState before_;     ///< the device in the step before
  bool heard_ = false;     ///< it is of this device
  double device_s_ = 0.0;  ///< device time that belongs to the present time
  bool trusted_ = false;
  double wall_s_ = 0.0;  ///< of the present step
  Wrench felt_, applied_;
  std::uint64_t jumps_ = 0;
};

}  // namespace subworld
