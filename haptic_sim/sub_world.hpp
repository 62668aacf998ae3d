#pragma once

#include "haptic_sim/device_side.hpp"
#include "haptic_sim/local_model.hpp"
#include "haptic_sim/loops/cycle_clock.hpp"
#include "haptic_sim/report_totals.hpp"
#include "haptic_sim/world_link.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/shells/engine_exchange.hpp"

#include <memory>
#include <span>
#include <string_view>

namespace subworld {

/// A sub-world after its latest step, frame or report.
struct SubWorldFacts {
  std::string_view engine;  ///< name of the engine that simulates it; empty where none does
  std::uint64_t stamp = 0;
  double time_s = 0.0;
  bool finite = true;
  BodyState proxy;
  std::size_t members = 0;
  std::size_t contacts = 0;
  std::size_t border_pairs = 0;
  double device_work_j = 0.0;
  std::uint64_t peers = 0;  ///< bit u: the device of user u, which is not held, moves a proxy or pushes a ghost of it
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
    if (!model_->reports_afterwards() && input.device != nullptr && (clock_.steps() == 0 || clock_.at_boundary()))
      on_report();
    advance(input.dt, input.peers);
    if (model_->reports_afterwards() && clock_.at_boundary()) on_report();
    return felt;
  }
  /// The answer to the device: the force for its operator, and, for an admittance device, where the proxy is and how it
  /// moves in wall time.
  [[nodiscard]] DeviceCommand command_for(const DeviceState& device, const Wrench& to_operator);
  /// Closes the cycle. Its report, which lives for several cycles; null where it is suppressed
  /// (coupling/messages/suppression), never in real time. `sent_ns` is the caller's clock.
  HapticReport* close_cycle(std::int64_t sent_ns);

  /// Whether a frame of this stamp may be used now: not before the sub-world has reached it.
  [[nodiscard]] bool accepts(std::uint64_t frame_stamp) const noexcept {
    return !model_->reports_afterwards() || frame_stamp <= clock_.stamp();
  }
  /// Whether no frame of this stamp will come; counts as used then.
  bool passes_frame(std::uint64_t stamp) noexcept { return link_.passes_frame(stamp); }
  /// Uses a frame whose stamp is not ahead of the sub-world's: blends, bodies that enter and leave, border.
  /// Returns the number of frames that are missing before it; a frame that is older than the newest one, or names
  /// bodies that the scene does not have, does nothing.
  std::uint64_t synchronise_with(const WorldFrame& frame);
  /// Gives up what the sub-world holds and starts again from the world's: for one that fell behind, is not finite, or
  /// joins. The coupling keeps its stretch, or takes that with which the world holds the proxy (`frame.peers`); then
  /// the force rises from zero. False where the frame brings no proxy: it is no beginning.
  bool reset_from(const WorldFrame& frame);

  /// Asks for another engine. Returns what came of it; exchange_engine() hands over between two steps,
  /// when the other one is ready, and ramps the force.
  OrderAnswer change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);

  [[nodiscard]] const SubWorldFacts& facts() const noexcept { return facts_; }
  [[nodiscard]] const CycleClock& clock() const noexcept { return clock_; }
  [[nodiscard]] const DeviceSide& device() const noexcept { return device_; }

 private:
  /// The clock, and the force for the device at the start of a step.
  FeltStep begin_step(const StepInput& input);
  void advance(double dt, std::span<const DeviceState* const> peers);
  HapticReport& report(std::int64_t sent_ns);
  /// Brings the facts of time, device, proxy and neighbourhood up to date.
  void look();

  const Scene& scene_;
  std::unique_ptr<LocalModel> model_;
  DeviceSide device_;
  WorldLink link_;
  CycleClock clock_;
  ReportTotals totals_;
  SubWorldFacts facts_;
};

}  // namespace subworld
