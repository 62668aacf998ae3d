#pragma once

#include "device_sim/device.hpp"
#include "device_sim/device_guard.hpp"
#include "io/results/program_results.hpp"
#include "program/loop_measures.hpp"
#include "wire/await.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"

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
  std::optional<Writer<DeviceState>> shared_states;  ///< for the other users' programs, in real time
  Reader<DeviceCommand> commands;
  StatusBeacon status;
};

enum class DeviceStage : std::uint8_t { wake, receive, decode, advance, send, account, count };
inline constexpr std::array kDeviceStages{"wake", "receive", "decode", "advance", "send", "account"};
static_assert(kDeviceStages.size() == Stages<DeviceStage>::kCount);

/// Measurements of a device process for its results, and its history.
class DeviceMeasures : public LoopMeasures<DeviceStage> {
 public:
  /// Throws `Error` (failed) for a file of --out or --trace that cannot be written.
  DeviceMeasures(const Options& options, const History::Say& say);
  void step(const DeviceState& state, const Wrench& wrench, const StepTimes& times) noexcept;
  /// Closes the step's stages. Call last in a step.
  void end_step() noexcept { LoopMeasures::end_step({}, {{Trace::Name::missed_deadline, newest_.miss != Miss::none}}); }
  /// This program takes the place of one that has died.
  void joins_late() noexcept { history_.append(); }
  /// A command that the haptic process cannot have sent was dropped. Returns the number of them.
  std::uint64_t forged_command() noexcept { return ++forged_commands_; }
  [[nodiscard]] std::uint64_t forged_commands() const noexcept { return forged_commands_; }
  /// Share of the states that were sent.
  void sent(double ratio) noexcept { sent_ratio_ = ratio; }
  /// Data of the loop for the status.
  [[nodiscard]] LoopState state(double time_s) const noexcept { return LoopMeasures::state(time_s, 0.0, 1.0); }
  /// After the last step.
  [[nodiscard]] DeviceResult result(const DeviceGuard& guard);

 private:
  int user_;
  double sent_ratio_ = 1.0;
  std::uint64_t forged_commands_ = 0;
};

/// Everything that a run of a device process consists of.
struct DeviceRun {
  const Options& options;
  const Scene& scene;
  DevicePorts& ports;
  Device& device;
  DeviceGuard& guard;
  DeviceMeasures& measures;
  SessionFinder& finder;
  std::uint64_t session = 0;  ///< of the world; 0: not joined yet

  [[nodiscard]] Peer haptic_sim() const noexcept { return {ProgramKind::haptic_sim, device.state().device}; }
  /// Sends a state of the device, and `to_all` users' programs where those need not have each.
  bool send_state(TimePoint now, DeviceState state, bool to_all = false) const noexcept;
};

/// Waits for the world's scene and the haptic process. Returns the world's session, or nothing after a request to stop.
/// Throws `Error` (failed, usage) that names the missing program.
[[nodiscard]] std::optional<std::uint64_t> join(const DeviceRun& run);

/// Lock-step: each step waits for the command that answers its state. Throws `Error` (failed) when the haptic process
/// dies or is restarted.
[[nodiscard]] Ending run_lockstep(const DeviceRun& run);

/// `Ending::by` of a run that the world has ended.
inline constexpr const char* kLastCommand = "last command";

/// Time in which a device's force rises again after missing commands, in real time.
inline constexpr double kFadeIn_s = 0.02;

/// Real time: at the device's own rate, with the newest command; the force of an old one fades out. The ending has a
/// fault if the haptic process has gone.
[[nodiscard]] Ending run_realtime(const DeviceRun& run);

}  // namespace subworld
