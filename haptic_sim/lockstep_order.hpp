#pragma once

#include "coupling/messages/deadband.hpp"
#include "coupling/messages/delay.hpp"
#include "haptic_sim/sub_world.hpp"

#include <cstdint>
#include <utility>
#include <vector>

namespace subworld {

/// The order of a sub-world's messages and steps in lock-step, under the artificial delays of the settings. The haptic
/// process and the lab's run in one process share it, so their results are equal bit by bit.
class LockstepOrder {
 public:
  /// `stamp`: where the sub-world begins; `step`: the haptic step of that.
  LockstepOrder(const Scene& scene, std::uint32_t user, std::uint64_t stamp = 0, std::uint64_t step = 0)
      : settings_(scene.settings),
        user_(user),
        delay_(scene.settings, scheme_of(scene.settings).properties.lead_cycles, user),
        states_(scene.settings, Direction::from_device, user, step),
        deadband_(scene.settings.deadband_in_use(), scene.users[user]),
        commands_(scene.settings, Direction::to_device, user, step),
        known_(static_cast<std::size_t>(scene.settings.users)),
        step_(step),
        next_frame_(stamp + 1) {
    if (!scheme_of(scene.settings).properties.replicates_peers) return;
    for (std::uint32_t u = 0; u < known_.size(); ++u) {
      const double period_s = scene.settings.sample_period_s(scene.users[u].device.rate_hz);
      peers_.push_back({line_from(u, step), period_s, step, step});
    }
  }

  /// Share of the commands that a link with a deadband has to send.
  [[nodiscard]] double sent_ratio() const noexcept { return deadband_.sent_ratio(); }
  /// The number of the step that comes next.
  [[nodiscard]] std::uint64_t next_step() const noexcept { return step_; }
  /// How many states of a peer's device have been heard since t = 0. Before step k, which needs them of the peers in
  /// the sub-world, there must be k + 1, but for those that it misses.
  [[nodiscard]] std::uint64_t heard(std::size_t peer) const noexcept { return peers_[peer].steps; }
  /// Before the first state, for measurements: the peers' states arrive at once, whatever the delay of the settings.
  void hear_at_once() {
    Settings at_once = settings_;
    at_once.delay = {};
    for (Peer& of : peers_) of.states = {at_once, Direction::from_peer, user_, step_};
  }
  /// A state of a peer's device: the next one or, of a program that was started again, the first of a later step.
  /// Dropped where the sub-world has had that step, or misses it.
  void hear(std::size_t peer, const DeviceState& state);
  /// Whether a state says that the peer's device has just been started again, and the one before will send no more. It
  /// does not know the time yet.
  [[nodiscard]] bool is_replaced(std::size_t peer, const DeviceState& state) const noexcept {
    return is_of_another(peer, state) && state.sequence == 0;
  }
  /// Whether it is of another process than the state before.
  [[nodiscard]] bool is_of_another(std::size_t peer, const DeviceState& state) const noexcept {
    return peers_[peer].heard_any && state.sender != peers_[peer].sender;
  }
  /// The same, also where no state of the one before has been heard.
  [[nodiscard]] bool has_just_started(std::size_t peer, const DeviceState& state) const noexcept {
    const Peer& of = peers_[peer];
    return is_replaced(peer, state) || (!of.heard_any && state.sequence == 0 &&
                                        state.stamp_s < settings_.h_s * (static_cast<double>(of.steps) - 0.5));
  }
  /// The state heard(peer) does not come: from now on the sub-world misses the peer's states.
  void miss(std::size_t peer) noexcept { peers_[peer].misses = true; }
  /// No longer: those of this step on count again.
  void hear_again(std::size_t peer) noexcept { peers_[peer].drops_before = step_; }
  /// The state of the peer's device that counts in the next step; null: none.
  [[nodiscard]] const DeviceState* known_of(std::size_t peer) const noexcept {
    const Peer& of = peers_[peer];
    return of.misses || of.from > step_ ? nullptr : of.newest;
  }
  /// Whether the run that this one repeats missed the peer's state of the next step.
  [[nodiscard]] bool misses_by_plan(std::size_t peer) const noexcept {
    return misses(settings_.presence, static_cast<int>(user_), static_cast<int>(peer), time_of(step_));
  }
  /// The orders of the plan that the sub-world follows before the next step.
  [[nodiscard]] std::vector<PresenceEvent> due() const {
    return due_orders(settings_.presence, static_cast<int>(user_), time_of(step_) - settings_.h_s, time_of(step_));
  }
  /// The states that the sub-world needed and missed since the last call.
  [[nodiscard]] std::vector<MissedStates> take_missed() { return std::exchange(missed_, {}); }

  /// Calls `take(stamp)` for each frame that is due before the next step; it returns false where none comes. False
  /// then.
  template <class Take>
  bool take_frames(SubWorld& sub, Take&& take) {
    for (; delay_.frame_due(next_frame_, sub.clock().timetable()) <= step_; ++next_frame_) {
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
      const DeviceCommand answer =
          deadband_.pass(sub.command_for(known, felt.to_operator), felt.to_operator, settings_.h_s);
      DeviceCommand command = commands_.pass(answer, step_);
      command.sequence = sent.sequence;  // each step of the device waits for its own answer
      command.echoed_sent_ns = sent.sent_ns;
      on_command(command, felt);
    };
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      known_[p] = known_of(p);
      if (peers_[p].misses && (sub.facts().peers >> p & 1U) != 0) note_missed(static_cast<std::uint32_t>(p));
    }
    const StepInput input{
        .device = &known, .peers = known_, .wall_s = settings_.h_s, .dt = settings_.h_s, .took_s = took_s};
    const FeltStep felt = sub.step(input, on_force, std::forward<OnReport>(on_report));
    ++step_;
    return felt;
  }

 private:
  struct Peer {
    DelayLine<DeviceState> states;
    double period_s = 0.0;    ///< longest regular time between two states
    std::uint64_t steps = 0;  ///< of the state that comes next
    std::uint64_t from = 0;   ///< first step that has a state, since the last that was missed
    bool heard_any = false;
    std::uint64_t sender = 0;  ///< of the newest state
    const DeviceState* newest = nullptr;
    bool misses = false;  ///< at present
    std::uint64_t drops_before = 0;
  };
  /// Apart from the users' numbers.
  static std::uint32_t link(std::uint32_t user, std::uint32_t peer) noexcept { return 64 * (user + 1) + peer; }
  [[nodiscard]] DelayLine<DeviceState> line_from(std::size_t peer, std::uint64_t step) const {
    return {settings_, Direction::from_peer, link(user_, static_cast<std::uint32_t>(peer)), step};
  }
  /// In the middle of rounding errors.
  [[nodiscard]] double time_of(std::uint64_t step) const noexcept {
    return settings_.h_s * (static_cast<double>(step) + 0.25);
  }
  /// In the next step.
  void note_missed(std::uint32_t peer);

  const Settings& settings_;
  std::uint32_t user_;
  Delay delay_;
  DelayLine<DeviceState> states_;
  Deadband<DeviceCommand> deadband_;
  DelayLine<DeviceCommand> commands_;
  std::vector<Peer> peers_;                ///< by user; none where the scheme does not replicate them
  std::vector<const DeviceState*> known_;  ///< by user; null: none heard
  std::vector<MissedStates> missed_;       ///< since they were taken
  std::uint64_t step_;                     ///< the next
  std::uint64_t next_frame_;               ///< stamp
};

}  // namespace subworld
