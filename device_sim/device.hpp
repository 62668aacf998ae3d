#pragma once

#include "model/messages/exchange.hpp"

#include <string>

namespace subworld {

/// What the loop of a device process works with: the emulated device, or one with a driver.
class Device {
 public:
  virtual ~Device() = default;
  /// The device at its last tick.
  [[nodiscard]] virtual const DeviceState& state() const noexcept = 0;
  /// Applies the command, and advances by dt (s).
  virtual void step(const DeviceCommand& command, double dt) noexcept = 0;
  /// In place of step() before the run: dt (s) pass without a command.
  virtual void idle(double) noexcept {}
  /// The device takes part in a run again from that time on, s.
  virtual void resume_at(double time_s) noexcept = 0;
  /// Its state is known. Otherwise no force may act, and no state is sent.
  [[nodiscard]] virtual bool present() const noexcept { return true; }
  /// A force may act on the operator.
  [[nodiscard]] virtual bool renders_force() const noexcept { return true; }
  /// What has happened since the last call, in words; usually empty.
  [[nodiscard]] virtual std::string news() { return {}; }
};

}  // namespace subworld
