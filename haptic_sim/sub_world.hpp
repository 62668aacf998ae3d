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

#include <algorithm>
#include <memory>
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
  double wall_s = 0.0;                  ///< since the step before
  double dt = 0.0;                      ///< simulated time that the step covers
};

/// One user's haptic sub-world: a small copy of the world around the proxy, stepped at the haptic rate, coupled to the
/// device and corrected from the world. A cycle is: `report`, `synchronise_with` the world's frame of the same stamp, r
/// steps.
class SubWorld {
 public:
  SubWorld(const Scene& scene, std::size_t user);

  /// One haptic step, in the one order there is: the force, then `on_force(felt)`, which sends it; the motion; and
  /// `on_report()` where a report is due, before the motion or after it, as the scheme has it.
  template <class OnForce, class OnReport>
  FeltStep step(const StepInput& input, OnForce&& on_force, OnReport&& on_report) {
    const FeltStep felt =
        input.device != nullptr ? feel(*input.device, input.device_trusted, input.wall_s) : FeltStep{};
    on_force(felt);
    if (report_due()) on_report();
    advance(input.dt);
    if (report_due()) on_report();
    return felt;
  }
  /// The force for the device at the start of a step of `wall_s`, before the sub-world moves: so that it leaves without
  /// delay.
  [[nodiscard]] FeltStep feel(const DeviceState& device, bool device_trusted, double wall_s);
  /// The answer to the device: the force for its operator, and, for an admittance device, where the proxy is and how it
  /// moves in wall time.
  [[nodiscard]] DeviceCommand command_for(const DeviceState& device, const Wrench& to_operator);
  void advance(double dt);
  /// The rate of the clock, simulated seconds per second, from the step on that begins now (coupling/tool). A clock
  /// that stands, 0, changes nothing: the tool goes on from the rate that it had.
  void set_rate(double rate);
  /// What the caller's clock says that a step took; the cycle's mean goes up with its report.
  void took(double step_s) noexcept {
    took_s_ += step_s;
    took_max_s_ = std::max(took_max_s_, step_s);
    ++timed_steps_;
  }
  /// The force fades to zero, and the coupling re-engages from there.
  void declutch() noexcept { guard_.declutch(); }
  /// The same after a sleep that was long enough for the device to let it go by itself.
  void re_engage() noexcept { guard_.restart(); }
  /// While the sub-world is paused the force fades to zero, and the device may move without moving the proxy. On resume
  /// the coupling restarts at the device's new position.
  void pause(bool paused) noexcept { declutch_.open(paused); }

  /// True when the steps since the last boundary fill a cycle: `report` is due.
  [[nodiscard]] bool at_boundary() const noexcept;
  /// Ask after feel() and after advance(): whether a report is due there. A sub-world tells how a cycle went; without
  /// one, a report tells with which device pose it begins.
  [[nodiscard]] bool report_due() const noexcept {
    return model_->reports_afterwards() ? !felt_now_ && at_boundary() : felt_now_ && (steps_ == 0 || at_boundary());
  }
  /// Whether a first report goes out before the first step.
  [[nodiscard]] bool reports_at_start() const noexcept { return model_->reports_afterwards(); }
  /// Whether a frame of this stamp may be used now: not before the sub-world has reached it.
  [[nodiscard]] bool accepts(std::uint64_t frame_stamp) const noexcept {
    return !model_->reports_afterwards() || frame_stamp <= stamp_;
  }
  /// Closes the cycle. Its report, which lives for several cycles; null where it is suppressed (coupling/suppression).
  /// `sent_ns` is the caller's clock.
  HapticReport* close_cycle(std::int64_t sent_ns);
  /// The same, with a report in any case.
  HapticReport& report(std::int64_t sent_ns);
  /// Whether no frame of this stamp will come; counts as used then.
  bool passes_frame(std::uint64_t stamp) noexcept;

  /// Uses a frame whose stamp is not ahead of stamp(): blends, bodies that enter and leave, border.
  /// Returns the number of frames that are missing before it; a frame that is older than the newest one, or names
  /// bodies that the scene does not have, does nothing.
  std::uint64_t synchronise_with(const WorldFrame& frame);
  /// Whether the frame counts cycles as the sub-world does. If not, a change of the ratio was missed: reset_from().
  [[nodiscard]] bool agrees(const WorldFrame& frame) const noexcept;
  /// Gives up what the sub-world holds and starts again from the world's: for one that fell behind or is not finite.
  /// False where the frame brings no proxy: it is no beginning.
  bool reset_from(const WorldFrame& frame);

  /// Asks for another engine. Returns what came of it, in words; exchange_engine() hands over between two steps,
  /// when the other one is ready, and ramps the force.
  std::string change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);

  [[nodiscard]] std::size_t user() const noexcept { return user_; }
  [[nodiscard]] std::uint64_t stamp() const noexcept { return stamp_; }
  [[nodiscard]] double time_s() const noexcept;
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }
  /// Simulation time until the next boundary.
  [[nodiscard]] double cycle_left_s() const noexcept;
  [[nodiscard]] bool finite() const noexcept { return finite_; }
  [[nodiscard]] BodyState proxy() const { return model_->proxy(); }
  /// In simulated time.
  [[nodiscard]] const DevicePose& device() const noexcept { return declutch_.device(); }
  [[nodiscard]] std::size_t members() const noexcept { return model_->members(); }
  [[nodiscard]] std::size_t contacts() const noexcept { return model_->contacts(); }
  [[nodiscard]] std::size_t border_pairs() const noexcept { return border_pairs_; }
  [[nodiscard]] double device_work_j() const noexcept { return device_work_j_; }
  /// The energy that crossed between the operator and this side of the device's link.
  [[nodiscard]] const OperatorPort& operator_port() const noexcept { return port_; }
  /// Device states that no operator can have reached since the one before.
  [[nodiscard]] std::uint64_t jumps() const noexcept { return jumps_; }
  /// Of the engine that simulates it; empty where none does.
  [[nodiscard]] std::string engine_name() const;
  [[nodiscard]] const Scheme& scheme() const noexcept { return scheme_; }

 private:
  /// Whether the device moved farther since the state before than an operator can move it.
  [[nodiscard]] bool jumped(const DeviceState& state, double wall_s) const noexcept;
  [[nodiscard]] bool knows(const WorldFrame& frame) const noexcept;
  /// Length of the cycle under way.
  [[nodiscard]] double cycle_s() const noexcept { return scene_.settings.h_s * timetable_.ratio(stamp_); }
  /// Whether the world waits for no report of the cycle that ends now.
  [[nodiscard]] bool suppresses_report() const;
  void begin_cycle();
  /// Notes which frame is in use.
  void note(const WorldFrame& frame) noexcept;

  const Scene& scene_;
  std::size_t user_;
  const UserSpec& spec_;
  const Scheme& scheme_;
  std::unique_ptr<LocalModel> model_;
  ForceLimits limits_;
  ForceGuard guard_;
  MotionGuard motion_;
  OperatorPort port_;
  Declutch declutch_;
  std::uint64_t jumps_ = 0;
  DeviceState before_;  ///< the device in the step before
  bool heard_ = false;
  bool trusted_ = false;
  double wall_s_ = 0.0;  ///< of the present step
  double rate_ = 1.0;    ///< of the clock
  Tool tool_;            ///< at that rate

  bool framed_ = false;            ///< a frame has been used
  std::uint64_t frame_stamp_ = 0;  ///< of the newest used
  std::size_t border_pairs_ = 0;
  bool reports_device_;
  bool may_suppress_;
  SuppressedCycles suppression_;

  Timetable timetable_;
  std::uint64_t stamp_ = 0;
  double in_cycle_s_ = 0.0;
  int steps_ = 0;
  bool felt_now_ = false;  ///< between feel() and advance()
  Indicators indicators_;
  Wrench impulse_total_;
  double device_work_j_ = 0.0;
  Wrench felt_;
  Wrench applied_;
  bool finite_ = true;
  double took_s_ = 0.0, took_max_s_ = 0.0;  ///< of the steps since the last report
  int timed_steps_ = 0;
  std::vector<HapticReport> reports_;  ///< by stamp
};

}  // namespace subworld
