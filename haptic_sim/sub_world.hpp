#pragma once

#include "coupling/energy_port.hpp"
#include "coupling/force_guard.hpp"
#include "coupling/motion_guard.hpp"
#include "coupling/scheme.hpp"
#include "coupling/suppression.hpp"
#include "coupling/timetable.hpp"
#include "haptic_sim/declutch.hpp"
#include "haptic_sim/local_model.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "physics/engine_exchange.hpp"

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace subworld {

/// What one haptic step brought.
struct FeltStep {
  Wrench felt;         ///< on the proxy, by the coupling at the start of the step
  Wrench to_operator;  ///< for the device: bounded, finite, ramped
};

/// What one haptic step needs.
struct StepInput {
  const DeviceState* device = nullptr;  ///< null: none has been received yet, and no force is felt
  bool device_trusted = true;           ///< its state is fresh
  /// By user, the newest state of the device of each whose proxy is in the sub-world (`SubWorldFacts::peers`); null:
  /// none has come, and the world's account of it counts.
  std::span<const DeviceState* const> peers = {};
  double wall_s = 0.0;  ///< since the step before
  double dt = 0.0;      ///< simulated time that the step covers
  /// Rate of the clock, simulated seconds per second (coupling/tool). A clock that stands, 0, changes nothing: the tool
  /// goes on from the rate that it had.
  double clock_rate = 1.0;
  double took_s = 0.0;  ///< time that the step before took, by the caller's clock; 0: not known
  /// While the sub-world is paused the force fades to zero, and the device may move without moving the proxy. On resume
  /// the coupling restarts at the device's new position.
  bool paused = false;
  /// The loop slept for so long that the device has let the force fade: it rises from zero.
  bool slept = false;
  /// The device is another one, or was away: from now on it is where it was in the scene, and the force rises from
  /// zero.
  bool device_returned = false;
};

/// A sub-world after its latest step, frame or report.
struct SubWorldFacts {
  std::string_view engine;  ///< name of the engine that simulates it; empty where none does
  std::uint64_t stamp = 0;
  double time_s = 0.0;
  double cycle_left_s = 0.0;  ///< simulation time until the next boundary
  bool at_boundary = false;   ///< the steps since the last boundary fill a cycle
  bool finite = true;
  BodyState proxy;
  DevicePose device;      ///< in simulated time
  double device_s = 0.0;  ///< time stamp of the device state that the last step used
  std::size_t members = 0;
  std::size_t contacts = 0;
  std::size_t border_pairs = 0;
  double device_work_j = 0.0;
  std::uint64_t peers = 0;  ///< bit u: the device of user u, which is not held, moves a proxy or pushes a ghost of it
  std::uint64_t jumps = 0;  ///< device states that no operator can have reached since the one before
};

/// One user's haptic sub-world: a small copy of the world around the proxy, stepped at the haptic rate, coupled to the
/// device and corrected from the world. A cycle is: `close_cycle`, `synchronise_with` the world's frame of the same
/// stamp, r steps.
class SubWorld {
 public:
  SubWorld(const Scene& scene, std::size_t user);

  /// One haptic step, in the one order there is: the force, then `on_force(felt)`, which sends it before the sub-world
  /// moves, so that it leaves without delay; the motion; and `on_report()`, which calls close_cycle(), where a report
  /// is due: before the motion or after it, as the scheme has it.
  template <class OnForce, class OnReport>
  FeltStep step(const StepInput& input, OnForce&& on_force, OnReport&& on_report) {
    const FeltStep felt = begin_step(input);
    on_force(felt);
    if (!model_->reports_afterwards() && input.device != nullptr && (steps_ == 0 || facts_.at_boundary)) on_report();
    advance(input.dt, input.peers);
    if (model_->reports_afterwards() && facts_.at_boundary) on_report();
    return felt;
  }
  /// The answer to the device: the force for its operator, and, for an admittance device, where the proxy is and how it
  /// moves in wall time.
  [[nodiscard]] DeviceCommand command_for(const DeviceState& device, const Wrench& to_operator);
  /// Closes the cycle. Its report, which lives for several cycles; null where it is suppressed (coupling/suppression),
  /// never in real time. `sent_ns` is the caller's clock.
  HapticReport* close_cycle(std::int64_t sent_ns);

  /// Whether a frame of this stamp may be used now: not before the sub-world has reached it.
  [[nodiscard]] bool accepts(std::uint64_t frame_stamp) const noexcept {
    return !model_->reports_afterwards() || frame_stamp <= facts_.stamp;
  }
  /// Whether no frame of this stamp will come; counts as used then.
  bool passes_frame(std::uint64_t stamp) noexcept;
  /// Uses a frame whose stamp is not ahead of the sub-world's: blends, bodies that enter and leave, border.
  /// Returns the number of frames that are missing before it; a frame that is older than the newest one, or names
  /// bodies that the scene does not have, does nothing.
  std::uint64_t synchronise_with(const WorldFrame& frame);
  /// Whether the frame counts cycles as the sub-world does. If not, a change of the ratio was missed: reset_from().
  [[nodiscard]] bool agrees(const WorldFrame& frame) const noexcept;
  /// Gives up what the sub-world holds and starts again from the world's: for one that fell behind, is not finite, or
  /// joins. The coupling keeps its stretch, or takes that with which the world holds the proxy (`frame.peers`); then
  /// the force rises from zero. False where the frame brings no proxy: it is no beginning.
  bool reset_from(const WorldFrame& frame);

  /// Asks for another engine. Returns what came of it; exchange_engine() hands over between two steps,
  /// when the other one is ready, and ramps the force.
  OrderAnswer change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);

  [[nodiscard]] const SubWorldFacts& facts() const noexcept { return facts_; }
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }
  /// The energy that crossed between the operator and this side of the device's link.
  [[nodiscard]] const OperatorPort& operator_port() const noexcept { return port_; }

 private:
  /// The clock, and the force for the device at the start of a step.
  FeltStep begin_step(const StepInput& input);
  void set_rate(double rate);
  [[nodiscard]] FeltStep feel(const DeviceState& device, bool device_trusted, double wall_s);
  void advance(double dt, std::span<const DeviceState* const> peers);
  HapticReport& report(std::int64_t sent_ns);
  /// Whether the device moved farther since the state before than an operator can move it.
  [[nodiscard]] bool jumped(const DeviceState& state, double wall_s) const noexcept;
  [[nodiscard]] bool knows(const WorldFrame& frame) const noexcept;
  /// Length of the cycle under way.
  [[nodiscard]] double cycle_s() const noexcept { return scene_.settings.h_s * timetable_.ratio(facts_.stamp); }
  /// Whether the world waits for no report of the cycle that ends now.
  [[nodiscard]] bool suppresses_report() const;
  void begin_cycle();
  /// Brings the facts of time, proxy and neighbourhood up to date.
  void look();
  /// Puts the device where the coupling has the stretch with which the world holds the proxy, or else the one that it
  /// had with the proxy `before`; the first frame leaves it where it is.
  void place_device(const WorldFrame& frame, bool first, const BodyState& before);
  /// Notes which frame is in use.
  void note(const WorldFrame& frame) noexcept;

  const Scene& scene_;
  std::size_t user_;
  const UserSpec& spec_;
  const Scheme& scheme_;
  std::unique_ptr<LocalModel> model_;
  SubWorldFacts facts_;
  ForceLimits limits_;
  ForceGuard guard_;
  MotionGuard motion_;
  OperatorPort port_;
  Declutch declutch_;
  DeviceState before_;     ///< the device in the step before
  double device_s_ = 0.0;  ///< device time that belongs to the present time
  bool heard_ = false;
  bool trusted_ = false;
  double wall_s_ = 0.0;  ///< of the present step
  double rate_ = 1.0;    ///< of the clock
  Tool tool_;            ///< at that rate

  bool framed_ = false;                       ///< a frame has been used
  std::uint64_t frame_stamp_ = 0;             ///< of the newest used
  std::uint64_t started_stamp_ = 0;           ///< of the one from which the sub-world has started
  std::optional<std::uint64_t> known_stamp_;  ///< of the newest report that the world is known to have used
  bool reports_device_;
  bool sends_changes_;
  bool omits_overruled_;
  bool may_suppress_;
  SuppressedCycles suppression_;

  Timetable timetable_;
  double in_cycle_s_ = 0.0;
  int steps_ = 0;
  Indicators indicators_;
  Wrench impulse_total_;
  Wrench felt_;
  Wrench applied_;
  double took_s_ = 0.0, took_max_s_ = 0.0;  ///< of the steps since the last report
  int timed_steps_ = 0;
  std::vector<HapticReport> reports_;  ///< by stamp
};

}  // namespace subworld
