#include "haptic_sim/lockstep_order.hpp"
#include "haptic_sim/loops/run.hpp"
#include "model/error.hpp"
#include "program/engine_orders.hpp"
#include "program/join.hpp"
#include "program/leave.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"

#include <fmt/core.h>

#include <cmath>
#include <set>
#include <utility>

namespace subworld {

namespace {

/// The haptic process in lock-step.
class LockstepLoop : HapticRun {
 public:
  explicit LockstepLoop(const HapticRun& run)
      : HapticRun(run),
        stages_(measures.stages()),
        order_(scene, user(), sub.facts().stamp, sub.clock().timetable().start(sub.facts().stamp)),
        device_sim_{ProgramKind::device_sim, user()},
        lost_(scene.users.size(), false),
        needed_(scene.users.size(), false) {
    reserve(frame_, kUsualMembers);
  }

  Ending run(const FirstFrame& first) {
    Ending ending{.session = ports.session, .from_s = sub.facts().time_s, .by = kLastFrame};
    ending.to_s = ending.from_s;
    stages_.begin();
    if (first.frame.last) {
      // The run was over before this user could take part.
      if (take_device()) send_last_command(ports, device_, 1);
      return ending;
    }
    if (!begin_device()) {
      ending.by = name_of_signal(stop_signal());
      return ending;
    }
    if (scheme().has_sub_worlds) send_report();
    while (order_.take_frames(sub, [this](std::uint64_t) { return take_frame(); }) && take_device() && take_peers())
      step();
    ending.to_s = sub.facts().time_s;
    measures.sent(order_.sent_ratio());
    if (last_) {
      send_last_command(ports, device_, 1);
      await_arrival(ports.reports, ports.status, kWorldSim, Clock::now());
    } else {
      ending.by = name_of_signal(stop_signal());
    }
    return ending;
  }

 private:
  static bool stopped() { return stop_signal() != 0; }

  /// False after the last frame, or when asked to stop.
  bool take_frame() {
    const auto ours = [this](const WorldFrame& came) { return came.session == ports.session; };
    if (!await(*ports.bus, ports.status, ports.frames, frame_, stages_, kWorldSim, ours, stopped)) return false;
    if (ports.serves_another(frame_)) throw Error(ExitCode::failed, displaced_text(ProgramKind::world_sim, 0));
    if (frame_.served == 0 && !frame_.last) {
      throw Error(
          ExitCode::failed,
          fmt::format("the world has gone on without user {}, whose programs were silent for seconds (halted, or "
                      "cut off); start haptic_sim and device_sim again",
                      user()));
    }
    const TimePoint begin = stages_.now();
    measures.answered(frame_.echoed_sent_ns, begin);
    last_ = frame_.last;
    if (last_ || frame_.served == ports.identity) measures.accepted();
    const std::uint64_t lost = sub.synchronise_with(frame_);
    measures.synchronised(to_seconds(stages_.mark(HapticStage::synchronise) - begin), lost);
    return !last_;
  }

  /// A device that has just been started begins at t = 0: in the middle of a run a command says the time, and the
  /// device answers with the state of that time. Of one of before, of which there may still be states, others follow.
  bool begin_device() {
    const double from_s = sub.facts().time_s;
    if (from_s == 0.0) return true;
    const Wanted device{fmt::format("device of user {}", user()), fmt::format("device_sim --user {}", user())};
    std::set<std::uint64_t> asked;
    const auto begun = [&] {
      while (ports.device.take(device_) == Take::sample) {
        if (device_.session != ports.session) continue;
        if (device_.sequence == 0) {
          asked.insert(device_.sender);
          if (!ports.command.write(sub.command_for(device_, {})))
            throw Error(ExitCode::failed, unsent_text("device_command", ports.device, ports.status, device_sim_));
        } else if (asked.erase(device_.sender) > 0 && std::abs(device_.stamp_s - from_s) < 0.5 * scene.settings.h_s) {
          return true;
        }
      }
      return false;
    };
    const auto comes = [&] { return ports.status.hears(ProgramKind::device_sim, user()); };
    if (!wait_for(*ports.bus, options, device, begun, comes)) return false;
    device_writer_ = device_.sender;
    ports.device.trust_sender();
    ports.status.begins(ProgramKind::device_sim, user(), ports.device.sender_participant());
    device_taken_ = true;
    return true;
  }

  bool take_device() {
    if (std::exchange(device_taken_, false)) return true;
    const auto ours = [this](const DeviceState& came) {
      return came.session == ports.session && (device_writer_ == 0 || came.sender == device_writer_);
    };
    if (!await(*ports.bus, ports.status, ports.device, device_, stages_, device_sim_, ours, stopped)) return false;
    device_writer_ = device_.sender;
    ports.device.trust_sender();
    return true;
  }

  /// The states of the other users' devices: of this step, where their proxies are in the sub-world; else those that
  /// have come.
  bool take_peers() {
    if (!scheme().replicates_peers) return true;
    for (std::uint32_t p = 0; p < scene.users.size(); ++p) {
      if (p != user() && !take_peer(p)) return false;
    }
    return true;
  }
  bool take_peer(std::uint32_t peer) {
    const bool needed = (sub.facts().peers >> peer & 1U) != 0;
    // A peer who returns takes part with another process.
    if (needed && !needed_[peer] && ports.status.is_replaced(ProgramKind::device_sim, peer))
      ports.status.begins(ProgramKind::device_sim, peer, 0);
    const bool goes_on = std::exchange(needed_[peer], needed) && needed;
    if (!needed && lost_[peer]) {
      lost_[peer] = false;
      order_.hear_again(peer);
    }
    if (lost_[peer]) return true;
    const bool awaited = needed && !order_.misses_by_plan(peer);
    AllDevices::Of reader = ports.all_devices->of(peer);
    // A state that says that its device has just been started is of one that waits for the world to let it take part:
    // then those of this step never come. It may also be old, and be followed by them.
    const auto ours = [&](const DeviceState& came) {
      return came.session == ports.session && !order_.has_just_started(peer, came);
    };
    while (order_.heard(peer) <= order_.next_step()) {
      if (awaited) {
        const auto lose = [&](const std::string& text) {
          // One that has ended in order was to leave: the world judges that.
          const bool left = ports.status.has_ended(ProgramKind::device_sim, peer) &&
                            ports.status.last_words(ProgramKind::device_sim, peer).empty();
          if (!left && scene.settings.absent == Absent::end) throw Error(ExitCode::failed, text + kEndsWithoutIt);
          lost_[peer] = true;
        };
        const Peer device{ProgramKind::device_sim, peer};
        if (!await(*ports.bus, ports.status, reader, peer_, stages_, device, ours, stopped, lose)) {
          if (lost_[peer]) order_.miss(peer);
          return lost_[peer];
        }
      } else {
        const Take taken = take(reader, peer_, stages_);
        if (taken == Take::none) break;
        if (taken != Take::sample || !ours(peer_)) continue;
      }
      // Whether one that was started again is in time for this step is a matter of luck: it counts once the world lets
      // it take part.
      if (goes_on && order_.is_of_another(peer, peer_)) {
        lost_[peer] = true;
        break;
      }
      order_.hear(peer, peer_);
    }
    if (needed && order_.heard(peer) <= order_.next_step()) order_.miss(peer);
    return true;
  }

  /// Those of the plan, and those that have come.
  void follow_all_orders() {
    const auto record = [this](std::string engine) {
      followed_.push_back({scene.settings.h_s * static_cast<double>(order_.next_step()), std::move(engine)});
    };
    for (const PresenceEvent& event : order_.due()) {
      check_planned(event, sub.change_engine(exchange, *order_for_sub_worlds(order_of(event))));
      record(event.order);
      follow_exchange();
    }
    if (std::string engine = follow_orders(); !engine.empty()) record(std::move(engine));
  }

  void step() {
    follow_all_orders();
    const TimePoint begin = stages_.mark(HapticStage::control);
    const auto send = [this](const DeviceCommand& command, const FeltStep&) {
      stages_.mark(HapticStage::feel);
      if (!ports.command.write(command))
        throw Error(ExitCode::failed, unsent_text("device_command", ports.device, ports.status, device_sim_));
      stages_.mark(HapticStage::send);
    };
    const FeltStep felt = order_.step(sub, device_, send, [this] {
      stages_.mark(HapticStage::advance);
      send_report();
    });
    measures.step(sub, felt, {to_seconds(stages_.mark(HapticStage::advance) - begin)});
    if (!sub.facts().finite)
      throw Error(ExitCode::failed, "the sub-world is no longer finite; use a smaller h_s or the preset quality");
    ports.status.update(measures.state(sub.facts().time_s));
    stages_.mark(HapticStage::account);
    measures.end_step();
  }

  void send_report() {
    HapticReport* const report = sub.close_cycle(to_ns(Clock::now()));
    if (report != nullptr) {
      report->missed = order_.take_missed();
      report->followed = std::exchange(followed_, {});
      if (!ports.send(*report))
        throw Error(ExitCode::failed, unsent_text("haptic_report", ports.frames, ports.status, kWorldSim));
    }
    stages_.mark(HapticStage::report);
  }

  static constexpr Peer kWorldSim{ProgramKind::world_sim, 0};

  Stages<HapticStage>& stages_;
  LockstepOrder order_;
  Peer device_sim_;
  DeviceState device_, peer_;
  WorldFrame frame_;
  std::vector<FollowedOrder> followed_;  ///< since the last report
  std::vector<bool> lost_;               ///< by user, whose device has fallen silent; the world's account of it counts
  std::vector<char> needed_;             ///< by user, whose device's states the last step needed
  std::uint64_t device_writer_ = 0;      ///< the process that sent the first state
  bool device_taken_ = false;            ///< the state of the first step
  bool last_ = false;
};

}  // namespace

Ending run_lockstep(const HapticRun& run, const FirstFrame& first) { return LockstepLoop(run).run(first); }

}  // namespace subworld
