#pragma once

#include "device_sim/device_guard.hpp"
#include "device_sim/emulated_device.hpp"
#include "io/ending.hpp"
#include "io/history.hpp"
#include "io/machine_share.hpp"
#include "io/options.hpp"
#include "io/results.hpp"
#include "io/trace.hpp"
#include "rt/stages.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <array>
#include <memory>
#include <optional>

namespace subworld {

/// Everything that enters or leaves a device process.
struct DevicePorts {
  DevicePorts(const Options& options, const Scene& scene);

  const std::uint64_t identity = draw_identity();
  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Writer<DeviceState> states;
  Reader<DeviceCommand> commands;
  StatusBeacon status;
};

enum class DeviceStage : std::uint8_t { wake, receive, decode, advance, send, account, count };
inline constexpr std::array kDeviceStages{"wake", "receive", "decode", "advance", "send", "account"};
static_assert(kDeviceStages.size() == Stages<DeviceStage>::kCount);

/// What a device process says of itself at the end, and its history on the way.
class DeviceMeasures {
 public:
  /// `folder` and `trace` may be empty: nothing is written.
  DeviceMeasures(const std::string& folder, const std::string& trace, int user, const History::Say& say);
  [[nodiscard]] Stages<DeviceStage>& stages() noexcept { return stages_; }
  void step(const DeviceState& state, const Wrench& wrench, const StepTimes& times) noexcept;
  /// Closes the step's stages: the last of all.
  void end_step() noexcept;
  void round_trip(double seconds) noexcept { round_trip_.add(seconds); }
  /// What the status shows.
  [[nodiscard]] LoopState state(double time_s) const noexcept {
    return {time_s, steps_, misses_.all(), misses_.by_os, step_.sum_s()};
  }
  /// Around a loop in real time, in its thread.
  void loop_begins(const Scheduling& granted) { machine_.begin(granted); }
  void loop_ends() { machine_.end(); }
  /// After the last step.
  [[nodiscard]] Json json(const DeviceGuard& guard);
  /// Why the history could not be written; empty: it could.
  [[nodiscard]] std::string fault() const { return history_.fault(); }

 private:
  int user_;
  History history_;
  Stages<DeviceStage> stages_;
  Trace trace_;
  bool newest_missed_ = false;
  Histogram round_trip_, step_, woken_late_;
  std::uint64_t steps_ = 0;
  Misses misses_;
  MachineShare machine_;
};

/// Waits until the world's scene and the haptic process are there. The world's session, or none when asked to stop.
/// Throws `Error` (failed, usage) that names what is missing.
[[nodiscard]] std::optional<std::uint64_t> join(DevicePorts& ports, const Scene& scene, const Options& options);

/// Each step waits for the command that answers the state. Throws `Error` (failed) when the haptic process dies or is
/// started again.
[[nodiscard]] Ending run_lockstep(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard,
                                  DeviceMeasures& measures, const Scene& scene, std::uint64_t session);

/// In which a device's force rises again after commands stayed away, in real time.
inline constexpr double kFadeIn_s = 0.02;

/// At the device's own rate, with the newest command; an old one fades out. A fault where the haptic process has gone.
/// `spin`: see Cyclic.
[[nodiscard]] Ending run_realtime(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard,
                                  DeviceMeasures& measures, const UserSpec& user, std::uint64_t session, Duration spin);

}  // namespace subworld
