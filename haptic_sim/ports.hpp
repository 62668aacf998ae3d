#pragma once

#include "io/options.hpp"
#include "wire/bus.hpp"
#include "wire/status.hpp"

#include <memory>
#include <optional>

namespace subworld {

/// Everything that enters or leaves a haptic process.
struct HapticPorts {
  HapticPorts(const Options& options, const Scene& scene);

  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Reader<DeviceState> device;
  Writer<DeviceCommand> command;
  std::optional<Reader<WorldFrame>> frames;     ///< by `open_world`
  std::optional<Writer<HapticReport>> reports;  ///< by `open_world`
  StatusBeacon status;

  /// Opens what the world looks for before it starts. To be called when all else is in place: a world that starts
  /// earlier runs without this user.
  void open_world(int user);
};

}  // namespace subworld
