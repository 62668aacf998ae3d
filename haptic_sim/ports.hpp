#pragma once

#include "io/options.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

namespace subworld {

/// Everything that enters or leaves a haptic process.
struct HapticPorts {
  HapticPorts(const Options& options, const Scene& scene);

  /// Sends what the sub-world has to say; as one of the run `session`.
  bool send(HapticReport& report) noexcept;

  /// The device of another user. In real time it is heard from the first call on: a peer that cannot be felt costs
  /// nothing. In lock-step it is heard from the start, because a late reader would miss steps.
  [[nodiscard]] Reader<DeviceState>& peer_device(std::size_t user);

  /// The world serves the first process that joins for a user; one that comes later, or again, is refused.
  [[nodiscard]] bool refused_by(const WorldFrame& frame) const noexcept {
    return frame.served != 0 && frame.served != identity;
  }

  const std::uint64_t identity = draw_identity();
  std::uint64_t session = 0;  ///< of the world; 0: not joined yet
  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Reader<DeviceState> device;
  Writer<DeviceCommand> command;
  Reader<Control> control;
  Reader<WorldFrame> frames;
  Writer<HapticReport> reports;
  StatusBeacon status;

 private:
  std::vector<std::optional<Reader<DeviceState>>> peer_devices_;  ///< by user
  std::vector<double> device_periods_s_;                          ///< by user
};

[[nodiscard]] std::string refused_text(std::uint32_t user);

/// Tells the device that the run is over, `times` times because one may get lost. `state`: the newest of the device.
void send_last_command(HapticPorts& ports, const DeviceState& state, int times);

}  // namespace subworld
