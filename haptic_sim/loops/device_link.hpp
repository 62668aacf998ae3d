#pragma once

#include "coupling/messages/deadband.hpp"
#include "haptic_sim/loops/run.hpp"
#include "program/peer_watch.hpp"
#include "wire/take.hpp"

#include <algorithm>

namespace subworld {

/// The device of a haptic process in real time: its newest state, and whether it is there.
class DeviceLink {
 public:
  explicit DeviceLink(const HapticRun& run)
      : ports_(run.ports),
        stale_s_(std::max(kStale_s, 5.0 / run.scene.users[run.user()].device.rate_hz) +
                 (run.scene.settings.deadband > 0.0 ? kLongestAbsence_s : 0.0)),
        extrapolates_(run.scene.settings.deadband_in_use() > 0.0),
        watch_({ProgramKind::device_sim, run.user()}, run.options.wait_s),
        state_{.device = run.user(), .pose = {}, .applied = {}} {}

  /// Takes what has come until `now`. Another device counts only where this one has been absent.
  void receive(TimePoint now, Stages<HapticStage>& stages) {
    returned_ = false;
    DeviceState came;
    while (take(ports_.device, came, stages) == Take::sample) {
      // After a restart of the world the device that is known finds the new session a little later.
      const bool known = heard() && came.sender == state_.sender;
      if (!known && (came.session != ports_.session || (heard() && !absent_))) continue;
      ports_.device.trust_sender();
      returned_ = returned_ || absent_;
      absent_ = false;
      state_ = sample_ = came;
      watch_.heard(now);
    }
    if (!heard()) return;
    if (age_s(now) > std::max(kAbsent_s, 2.0 * stale_s_) && !absent_) {
      absent_ = true;
      ports_.device.distrust();
    }
    if (!extrapolates_ || age_s(now) <= 0.0) return;
    state_ = extrapolated(sample_, std::min(age_s(now), kLongestAbsence_s));
    state_.sent_ns = 0;  // the round trip is of samples that came
  }

  [[nodiscard]] PeerWatch& watch() noexcept { return watch_; }
  [[nodiscard]] const DeviceState& state() const noexcept { return state_; }
  [[nodiscard]] bool heard() const noexcept { return watch_.last_heard() != TimePoint{}; }
  /// A force may rely on the state.
  [[nodiscard]] bool fresh(TimePoint now) const noexcept { return heard() && age_s(now) < stale_s_; }
  [[nodiscard]] bool absent() const noexcept { return absent_; }
  /// In this step: it is another one, or was away.
  [[nodiscard]] bool returned() const noexcept { return returned_; }

 private:
  static constexpr double kStale_s = 0.005;  ///< age of a device's state on which no force relies
  [[nodiscard]] double age_s(TimePoint now) const noexcept { return to_seconds(now - watch_.last_heard()); }

  HapticPorts& ports_;
  double stale_s_;  ///< age of the state at which the force fades out
  bool extrapolates_;
  PeerWatch watch_;
  DeviceState state_, sample_;  ///< the sample is the newest that came, from which the state is extrapolated
  bool absent_ = false, returned_ = false;
};

}  // namespace subworld
