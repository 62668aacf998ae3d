#pragma once

#include "io/options.hpp"
#include "wire/bus.hpp"
#include "wire/status.hpp"

#include <memory>

namespace subworld {

/// Everything that enters or leaves a haptic process.
struct HapticPorts {
  HapticPorts(const Options& options, const Scene& scene);

  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Reader<DeviceState> device;
  Writer<DeviceCommand> command;
  Reader<Control> control;
  Reader<WorldFrame> frames;
  Writer<HapticReport> reports;
  StatusBeacon status;
};

}  // namespace subworld
