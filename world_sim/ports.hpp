#pragma once

#include "io/options.hpp"
#include "wire/bus.hpp"
#include "wire/status.hpp"

#include <memory>
#include <vector>

namespace subworld {

/// Everything that enters or leaves the world process.
struct WorldPorts {
  WorldPorts(const Options& options, const Scene& scene);

  std::unique_ptr<Bus> bus;
  Writer<SceneDescription> scene;
  std::vector<Writer<WorldFrame>> frames;     ///< by user
  std::vector<Reader<HapticReport>> reports;  ///< by user
  Writer<WorldSnapshot> snapshots;
  Reader<Control> control;
  StatusBeacon status;
};

}  // namespace subworld
