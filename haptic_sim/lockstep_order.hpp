#pragma once

#include "coupling/delay.hpp"
#include "haptic_sim/sub_world.hpp"

#include <cstdint>
#include <utility>

namespace subworld {

/// The order of a sub-world's messages and steps in lock-step, under the artificial delays of the settings. The haptic
/// process and the lab's run in one process share it, so their results are equal bit by bit.
class LockstepOrder {
 public:
  LockstepOrder(const Scene& scene, std::uint32_t user)
      : h_s_(scene.settings.h_s),
        delay_(scene.settings, scheme_of(scene.settings).properties.lead_cycles, user),
        states_(scene.settings, Direction::from_device, user),
        commands_(scene.settings, Direction::to_device, user) {}

  /// Calls `take(stamp)` for each frame that is due before the next step; it returns false where none comes. False
  /// then.
  template <class Take>
  bool take_frames(SubWorld& sub, Take&& take) {
    for (; delay_.frame_due(next_frame_, sub.timetable()) <= step_; ++next_frame_) {
      if (sub.passes_frame(next_frame_)) continue;
      if (!take(next_frame_)) return false;
    }
    return true;
  }

  /// The next step, for the state that the device sends now. `on_command(command, felt)` gets the command that arrives
  /// at the device in this step; `on_report()` is called where a report is due. `took_s`: see StepInput.
  template <class OnCommand, class OnReport>
  FeltStep step(SubWorld& sub, const DeviceState& sent, OnCommand&& on_command, OnReport&& on_report,
                double took_s = 0.0) {
    const DeviceState& known = states_.pass(sent, step_);
    const auto on_force = [&](const FeltStep& felt) {
      DeviceCommand command = commands_.pass(sub.command_for(known, felt.to_operator), step_);
      command.sequence = sent.sequence;  // each step of the device waits for its own answer
      command.echoed_sent_ns = sent.sent_ns;
      on_command(command, felt);
    };
    const StepInput input{.device = &known, .wall_s = h_s_, .dt = h_s_, .took_s = took_s};
    const FeltStep felt = sub.step(input, on_force, std::forward<OnReport>(on_report));
    ++step_;
    return felt;
  }

 private:
  double h_s_;
  Delay delay_;
  DelayLine<DeviceState> states_;
  DelayLine<DeviceCommand> commands_;
  std::uint64_t step_ = 0;        ///< the next
  std::uint64_t next_frame_ = 1;  ///< stamp
};

}  // namespace subworld
