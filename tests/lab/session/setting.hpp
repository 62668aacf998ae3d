#pragma once

#include <string>

namespace subworld {

/// An engine with its preset, and the step of its world.
struct EngineSetting {
  std::string engine;
  std::string preset;
  double dt_s = 0.001;

  [[nodiscard]] std::string name() const { return engine + " " + preset; }
  friend bool operator==(const EngineSetting&, const EngineSetting&) = default;
};

/// A signal asked to stop.
struct Interrupted {};

}  // namespace subworld
