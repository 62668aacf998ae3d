#include "coupling/delay.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "world_sim/cycle.hpp"
#include "world_sim/run.hpp"
#include "world_sim/snapshots.hpp"

#include <fmt/format.h>

#include <limits>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kLastReport_s = 0.3;  ///< that a report may take after the world was asked to stop

/// The world process in lock-step.
class LockstepLoop {
 public:
  LockstepLoop(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange, const Scene& scene)
      : ports_(ports),
        world_(world),
        measures_(measures),
        stages_(measures.stages()),
        cycle_(ports, world, measures, exchange),
        snapshots_(ports.snapshots),
        next_report_(world.user_count(), 0) {
    reserve(report_, kUsualMembers);
    const int lead_cycles = world.scheme().properties.lead_cycles;
    for (std::size_t u = 0; u < world.user_count(); ++u)
      delays_.emplace_back(scene.settings, lead_cycles, static_cast<std::uint32_t>(u));
  }

  Ending run() {
    cycle_.publish_frames(false, 0.0, 1.0);
    stages_.begin();
    for (bool last = false; !last;) {
      if (!receive_due()) {
        cycle_.publish_frames(true, 0.0, 1.0);
        break;
      }
      wait_while_paused();
      last = step();
    }
    measures_.bodies().record_now(world_);
    if (world_.scheme().properties.has_sub_worlds && receive_due()) world_.synchronise();
    cycle_.close();
    return cycle_.ending();
  }

 private:
  void wait_while_paused() {
    cycle_.follow_orders();
    while (!cycle_.control().may_step() && !cycle_.control().stopped() && stop_signal() == 0) {
      ports_.bus->wait(0.05);
      cycle_.follow_orders();
    }
  }

  /// A cycle. True for the last one.
  bool step() {
    const TimePoint begin = stages_.mark(WorldStage::control);
    cycle_.step();
    // A stop takes effect between cycles, and as a last frame: so every program ends in order.
    const bool last = world_.over() || stop_signal() != 0 || cycle_.control().stopped();
    cycle_.publish_frames(last, 0.0, 1.0);
    measures_.cycle(world_, {to_seconds(stages_.mark(WorldStage::send) - begin)}, 1.0, 0.0);
    measures_.bodies().record(world_, std::numeric_limits<double>::infinity());
    if (snapshots_.wanted(world_.time_s()) || last) {
      world_.look(view_);
      snapshots_.publish(view_, last);
    }
    ports_.status.update(measures_.state(world_, 1.0));
    stages_.mark(WorldStage::display);
    measures_.end_cycle();
    cycle_.check_finite();
    return last;
  }

  /// Receives every report that the world uses before its next cycle. False when asked to stop and one does not come.
  bool receive_due() {
    for (std::size_t u = 0; u < world_.user_count(); ++u) {
      for (std::uint64_t& next = next_report_[u]; delays_[u].report_due(next, world_.stamp(), world_.timetable());
           ++next) {
        if (!world_.has_report(u, next) && !receive(u, next)) return false;
      }
    }
    return true;
  }

  bool receive(std::size_t user, std::uint64_t stamp) {
    const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(user)};
    const auto ours = [&](const HapticReport& came) { return ports_.accept(user, came); };
    const auto gives_up = [this] { return gives_up_at_signal(); };
    if (!await(*ports_.bus, ports_.status, ports_.reports[user], report_, stages_, haptic, ours, gives_up))
      return false;
    if (world_.receive(std::move(report_)) && world_.has_report(user, stamp)) return true;
    throw Error(ExitCode::failed, fmt::format("haptic_sim {} sent a report out of turn at stamp {}; are two of them on "
                                              "this domain?",
                                              user, world_.stamp()));
  }

  /// After a stop signal the world waits a little longer: a report that comes lets every program end in order.
  bool gives_up_at_signal() {
    if (stop_signal() == 0) return false;
    if (asked_ == TimePoint{}) asked_ = Clock::now();
    return to_seconds(Clock::now() - asked_) > kLastReport_s;
  }

  WorldPorts& ports_;
  World& world_;
  WorldMeasures& measures_;
  Stages<WorldStage>& stages_;
  WorldCycle cycle_;
  Snapshots snapshots_;
  WorldView view_;
  HapticReport report_;
  std::vector<Delay> delays_;               ///< by user
  std::vector<std::uint64_t> next_report_;  ///< by user: the stamp that is received next
  TimePoint asked_{};                       ///< to stop
};

}  // namespace

Ending run_lockstep(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                    const Scene& scene) {
  return LockstepLoop(ports, world, measures, exchange, scene).run();
}

}  // namespace subworld
