#pragma once

#include "haptic_sim/loops/peer_devices.hpp"
#include "io/options/options.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <memory>
#include <string>

namespace subworld {

/// Everything that enters or leaves a haptic process.
struct HapticPorts {
  HapticPorts(const Options& options, const Scene& scene);

  /// Sends what the sub-world has to say; as one of the run `session`.
  bool send(HapticReport& report) noexcept;

  /// The programs whose samples were refused, as far as they are known.
  [[nodiscard]] std::string foreign_programs() const;
  /// The world serves the first process that joins for a user, until the user is absent.
  [[nodiscard]] bool serves_another(const WorldFrame& frame) const noexcept {
    return frame.served != 0 && frame.served != identity;
  }
  /// A sign of life from either: on a busy machine a vendor may lose the liveliness of a writer that lives.
  [[nodiscard]] bool world_lives() const noexcept {
    return scene.alive_writers() > 0 || status.hears(ProgramKind::world_sim, 0);
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
  PeerDevices peer_devices;               ///< in real time
  std::optional<AllDevices> all_devices;  ///< in lock-step, where sub-worlds need them
};

/// Tells the device that the run is over, `times` times because one may get lost. `state`: the newest of the device.
void send_last_command(HapticPorts& ports, const DeviceState& state, int times);

}  // namespace subworld
