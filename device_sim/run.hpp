#pragma once

#include "device_sim/device_guard.hpp"
#include "device_sim/emulated_device.hpp"
#include "io/ending.hpp"
#include "io/history.hpp"
#include "io/options.hpp"
#include "io/program_results.hpp"
#include "io/trace.hpp"
#include "rt/stages.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <array>
#include <memory>
#include <optional>

namespace subworld {

/// All topics of a device process.
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

/// Measurements of a device process for its results, and its history.
class DeviceMeasures {
 public:
  /// `folder` and `trace` may be empty: writes nothing.
  DeviceMeasures(const std::string& folder, const std::string& trace, int user, const History::Say& say);
  [[nodiscard]] Stages<DeviceStage>& stages() noexcept { return stages_; }
  void step(const DeviceState& state, const Wrench& wrench, const StepTimes& times) noexcept;
  /// Closes the step's stages. Call last in a step.
  void end_step() noexcept;
  void round_trip(double seconds) noexcept { round_trip_.add(seconds); }
  /// Data of the loop for the status.
  [[nodiscard]] LoopState state(double time_s) const noexcept {
    return {time_s, steps_, misses_.all(), misses_.by_os, step_.sum_s()};
  }
  /// loop_begins() and loop_ends() enclose a loop in real time; call them in its thread.
  void loop_begins(const Scheduling& granted) { machine_.begin(granted); }
  void loop_ends() { machine_.end(); }
  /// After the last step.
  [[nodiscard]] DeviceResult result(const DeviceGuard& guard);
  /// Why the history could not be written; empty if there was no error.
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

/// Waits for the world's scene and the haptic process. Returns the world's session, or nothing after a request to stop.
/// Throws `Error` (failed, usage) that names the missing program.
[[nodiscard]] std::optional<std::uint64_t> join(DevicePorts& ports, const Scene& scene, const Options& options);

/// Lock-step: each step waits for the command that answers its state. Throws `Error` (failed) when the haptic process
/// dies or is restarted.
[[nodiscard]] Ending run_lockstep(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard,
                                  DeviceMeasures& measures, const Scene& scene, std::uint64_t session);

/// Time in which a device's force rises again after missing commands, in real time.
inline constexpr double kFadeIn_s = 0.02;

/// Real time: at the device's own rate, with the newest command; the force of an old one fades out. The ending has a
/// fault if the haptic process has gone. `spin`: see Cyclic.
[[nodiscard]] Ending run_realtime(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard,
                                  DeviceMeasures& measures, const UserSpec& user, std::uint64_t session, Duration spin);

}  // namespace subworld
