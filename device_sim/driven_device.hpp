#pragma once

#include "device_sim/device.hpp"
#include "device_sim/driver_check.hpp"
#include "device_sim/driver_thread.hpp"
#include "io/results/program_results.hpp"
#include "model/scene/scene.hpp"

#include <string>

namespace subworld {

/// How a device is used.
struct DeviceUse {
  std::string settings;      ///< of its driver
  double scale_ratio = 1.0;  ///< metres in the scene for a metre of the device
  double wait_s = 30.0;      ///< longest wait for the first reading
  int declutch_button = -1;  ///< while it is pressed, the device moves without the proxy; -1: none
  int domain = 0;            ///< of the run
};

/// A device that a driver serves. `state()` is the newest good reading: relative to the first one, with the scale, and
/// with a velocity of its own where the driver measures none. While the declutch button is pressed (indexing), the
/// state rests and no force acts; after that, the state goes on from there.
///
/// The device is absent while its driver has lost it, or while no good reading has arrived for `silent_s()`. Then its
/// velocity is zero and present() is false. It stays absent for so long that haptic_sim counts it as absent too: on its
/// return the coupling restarts where it is (haptic_sim/declutch).
class DrivenDevice final : public Device {
 public:
  /// Opens the driver and waits for the first good reading. Throws `Error` (failed, usage).
  DrivenDevice(const DriverPlugin& plugin, const DeviceUse& use, const DeviceSpec& spec, std::uint32_t device);

  [[nodiscard]] const DeviceState& state() const noexcept override { return state_; }
  void step(const DeviceCommand& command, double dt) noexcept override;
  void idle(double dt) noexcept override;
  void resume_at(double time_s) noexcept override { state_.stamp_s = std::max(state_.stamp_s, time_s); }
  [[nodiscard]] bool present() const noexcept override { return present_; }
  [[nodiscard]] bool renders_force() const noexcept override {
    return capabilities_.force_limit_n > 0.0 && !declutched_;
  }
  [[nodiscard]] std::string news() override;

  [[nodiscard]] const DriverCapabilities& capabilities() const noexcept { return capabilities_; }
  /// Age of the newest good reading from which the device is absent: 10 ms, or 5 periods if longer.
  [[nodiscard]] double silent_s() const noexcept { return silent_s_; }
  [[nodiscard]] DriverResult result() const;

 private:
  void observe(double dt) noexcept;
  void use(const DriverReading& reading) noexcept;
  [[nodiscard]] Pose pose_of(const DriverReading& reading) const noexcept;

  std::string name_;
  DeviceUse use_;
  DriverThread driver_;
  DriverCapabilities capabilities_;
  double silent_s_ = 0.0;
  double shortest_absence_s_ = 0.0;
  DriverReading first_, last_;  ///< first_: the reading at which the pose was base_
  Pose base_;
  bool declutched_ = false;
  std::uint64_t seen_ = 0;     ///< number of the newest sample
  std::uint64_t reports_ = 0;  ///< number of the newest report
  bool present_ = true;
  double quiet_s_ = 0.0;   ///< since the newest good reading
  double absent_s_ = 0.0;  ///< since it is absent
  DeviceState state_;
  std::string news_;
  DriverResult result_;
  std::array<std::uint64_t, static_cast<std::size_t>(ReadingFault::count)> refused_{};
};

/// The spec of the user's device within the limits of a real one. Throws `Error` (usage) if the scene's device cannot
/// be this one.
[[nodiscard]] DeviceSpec within_limits(DeviceSpec spec, const DriverCapabilities& capabilities, std::string_view name);

}  // namespace subworld
