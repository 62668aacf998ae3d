#include "coupling/delay.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "world_sim/loop.hpp"
#include "world_sim/snapshots.hpp"

#include <fmt/format.h>

#include <limits>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kLastReport_s = 0.3;  ///< that a report may take after the world was asked to stop

/// The world process in lock-step.
class LockstepLoop : WorldLoop {
 public:
  explicit LockstepLoop(const WorldRun& run)
      : WorldLoop(run), snapshots_(ports.snapshots), next_report_(user_count(), 0) {
    for (std::uint32_t u = 0; u < user_count(); ++u) delays_.emplace_back(scene.settings, scheme_.lead_cycles, u);
  }

  Ending run() {
    publish_frames(false, 0.0, 1.0);
    stages_.begin();
    for (bool last = false; !last;) {
      if (!receive_due()) {
        publish_frames(true, 0.0, 1.0);
        break;
      }
      if (world.facts().stamp == 0) measures.bodies().record_now(world);
      wait_while_paused();
      last = step();
    }
    measures.bodies().record_now(world);
    if (scheme_.has_sub_worlds) receive_due();
    close();
    return ending();
  }

 private:
  void wait_while_paused() {
    follow_orders();
    while (!control_.may_step() && !control_.stopped() && stop_signal() == 0) {
      ports.bus->wait(0.05);
      follow_orders();
    }
  }

  /// A cycle. True for the last one.
  bool step() {
    const TimePoint begin = stages_.mark(WorldStage::control);
    world.step([this](WorldStage stage) { stages_.mark(stage); });
    // A stop takes effect between cycles, and as a last frame: so every program ends in order.
    const bool last = world.facts().over || stop_signal() != 0 || control_.stopped();
    publish_frames(last, 0.0, 1.0);
    measures.cycle(world, {to_seconds(stages_.mark(WorldStage::send) - begin)}, 1.0, 0.0);
    measures.bodies().record(world, std::numeric_limits<double>::infinity());
    if (snapshots_.wanted(world.facts().time_s) || last) {
      world.look(view_);
      snapshots_.publish(view_, last);
    }
    ports.status.update(measures.state(world, 1.0));
    end_cycle();
    return last;
  }

  /// Receives every report that the world uses before its next cycle. False when asked to stop and one does not come.
  bool receive_due() {
    for (std::size_t u = 0; u < user_count(); ++u) {
      for (std::uint64_t& next = next_report_[u]; delays_[u].report_due(next, world.facts().stamp, world.timetable());
           ++next) {
        if (!world.has_report(u, next) && !receive(u, next)) return false;
      }
    }
    return true;
  }

  bool receive(std::size_t user, std::uint64_t stamp) {
    const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(user)};
    const auto ours = [&](const HapticReport& came) {
      if (!ports.belongs(user, came)) return false;
      ports.serve(user, came.sender);
      return true;
    };
    const auto gives_up = [this] { return gives_up_at_signal(); };
    if (!await(*ports.bus, ports.status, ports.reports[user], report_, stages_, haptic, ours, gives_up)) return false;
    if (world.receive(std::move(report_)) && world.has_report(user, stamp)) return true;
    throw Error(ExitCode::failed, fmt::format("haptic_sim {} sent a report out of turn at stamp {}; are two of them on "
                                              "this domain?",
                                              user, world.facts().stamp));
  }

  /// After a stop signal the world waits a little longer: a report that comes lets every program end in order.
  bool gives_up_at_signal() {
    if (stop_signal() == 0) return false;
    if (asked_ == TimePoint{}) asked_ = Clock::now();
    return to_seconds(Clock::now() - asked_) > kLastReport_s;
  }

  Snapshots snapshots_;
  WorldView view_;
  std::vector<Delay> delays_;               ///< by user
  std::vector<std::uint64_t> next_report_;  ///< by user: the stamp that is received next
  TimePoint asked_{};                       ///< to stop
};

}  // namespace

Ending run_lockstep(const WorldRun& run) { return LockstepLoop(run).run(); }

}  // namespace subworld
