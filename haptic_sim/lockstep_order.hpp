#pragma once

#include "coupling/deadband.hpp"
#include "coupling/delay.hpp"
#include "haptic_sim/sub_world.hpp"

#include <cstdint>
#include <utility>
#include <vector>

namespace subworld {

/// The order of a sub-world's messages and steps in lock-step, under the artificial delays of the settings. The haptic
/// process and the lab's run in one process share it, so their results are equal bit by bit.
class LockstepOrder {
 public:
  LockstepOrder(const Scene& scene, std::uint32_t user)
      : h_s_(scene.settings.h_s),
        delay_(scene.settings, scheme_of(scene.settings).properties.lead_cycles, user),
        states_(scene.settings, Direction::from_device, user),
        deadband_(scene.settings.deadband_in_use(), scene.users[user]),
        commands_(scene.settings, Direction::to_device, user),
        known_(static_cast<std::size_t>(scene.settings.users)) {
    if (!scheme_of(scene.settings).properties.replicates_peers) return;
    for (std::uint32_t u = 0; u < known_.size(); ++u)
      peers_.emplace_back(scene.settings, Direction::from_peer, link(user, u));
  }

  /// Share of the commands that a link with a deadband has to send.
  [[nodiscard]] double sent_ratio() const noexcept { return deadband_.sent_ratio(); }
  /// The number of the step that comes next.
  [[nodiscard]] std::uint64_t next_step() const noexcept { return step_; }
  /// How many states of a peer's device have been heard. Before step k, which needs them of the peers in the sub-world,
  /// there must be k + 1.
  [[nodiscard]] std::uint64_t heard(std::size_t peer) const noexcept { return peers_[peer].steps; }
  /// The state that a peer's device sends in the step heard(peer).
  void hear(std::size_t peer, const DeviceState& state) noexcept {
    Peer& from = peers_[peer];
    known_[peer] = &from.states.pass(state, from.steps++);
  }

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
      const DeviceCommand answer = deadband_.pass(sub.command_for(known, felt.to_operator), felt.to_operator, h_s_);
      DeviceCommand command = commands_.pass(answer, step_);
      command.sequence = sent.sequence;  // each step of the device waits for its own answer
      command.echoed_sent_ns = sent.sent_ns;
      on_command(command, felt);
    };
    const StepInput input{.device = &known, .peers = known_, .wall_s = h_s_, .dt = h_s_, .took_s = took_s};
    const FeltStep felt = sub.step(input, on_force, std::forward<OnReport>(on_report));
    ++step_;
    return felt;
  }

 private:
  struct Peer {
    Peer(const Settings& settings, Direction direction, std::uint32_t link) : states(settings, direction, link) {}
    DelayLine<DeviceState> states;
    std::uint64_t steps = 0;  ///< heard
  };
  /// Apart from the users' numbers.
  static std::uint32_t link(std::uint32_t user, std::uint32_t peer) noexcept { return 64 * (user + 1) + peer; }

  double h_s_;
  Delay delay_;
  DelayLine<DeviceState> states_;
  Deadband<DeviceCommand> deadband_;
  DelayLine<DeviceCommand> commands_;
  std::vector<Peer> peers_;                ///< by user; none where the scheme does not replicate them
  std::vector<const DeviceState*> known_;  ///< by user; null: none heard
  std::uint64_t step_ = 0;                 ///< the next
  std::uint64_t next_frame_ = 1;           ///< stamp
};

}  // namespace subworld
