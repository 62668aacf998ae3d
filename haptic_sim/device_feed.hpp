#pragma once

#include "haptic_sim/measures.hpp"
#include "haptic_sim/ports.hpp"
#include "program/peer_watch.hpp"
#include "wire/take.hpp"

#include <algorithm>

namespace subworld {

/// The newest state of the user's device, in real time.
class DeviceFeed {
 public:
  DeviceFeed(std::uint32_t device, double rate_hz)
      : period_s_(1.0 / rate_hz), watch_({ProgramKind::device_sim, device}) {
    state_.device = device;
  }

  /// Takes what has come; the first device that is heard stays the one.
  void receive(HapticPorts& ports, Stages<HapticStage>& stages, TimePoint now) {
    while (take(ports.device, came_, stages) == Take::sample) {
      if (came_.session != ports.session || (heard() && came_.sender != state_.sender)) continue;
      ports.device.trust_sender();
      state_ = came_;
      watch_.heard(now);
    }
  }

  /// Once a step of `period_s`: whether the device is still there.
  void observe(const HapticPorts& ports, TimePoint now, double period_s) noexcept {
    watch_.observe(ports.device, ports.status, now, period_s);
  }
  [[nodiscard]] std::string fault() const { return watch_.fault(); }
  [[nodiscard]] const DeviceState& state() const noexcept { return state_; }
  [[nodiscard]] bool heard() const noexcept { return watch_.last_heard() != TimePoint{}; }
  /// Whether the state is young enough for a force to rely on.
  [[nodiscard]] bool fresh(TimePoint now) const noexcept {
    return heard() && to_seconds(now - watch_.last_heard()) < std::max(kStale_s, 5.0 * period_s_);
  }

 private:
  static constexpr double kStale_s = 0.005;

  double period_s_;
  DeviceState state_, came_;
  PeerWatch watch_;
};

}  // namespace subworld
