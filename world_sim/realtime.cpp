#include "model/error.hpp"
#include "program/peer_watch.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "world_sim/loop.hpp"
#include "world_sim/pace.hpp"
#include "world_sim/snapshots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kStartIn_s = 0.2;
constexpr double kStartInBetweenHosts_s = 0.7;  ///< haptic clocks are ahead by the round trip

/// Announces when the world's clock slows, and when it is back at full speed.
void announce_pace(StatusBeacon& status, Pace& pace, double cycle_s) {
  const char* const cure = "cure: fewer bodies, a larger --ratio, --preset fast or a faster engine";
  switch (pace.take_news()) {
    case Pace::News::none:
      break;
    case Pace::News::slowed:
      status.note(fmt::format("the world needs {:.1f} ms of a {:g} ms cycle: its clock runs at {:.2f}; {}",
                              1e3 * pace.cost_s(), 1e3 * cycle_s, pace.real_time_factor(), cure));
      break;
    case Pace::News::stuck:
      status.note(
          fmt::format("the world needs {:.0f} ms of a {:g} ms cycle, more than its slowest clock ({:g}) gives "
                      "it: it stops and goes; {}",
                      1e3 * pace.cost_s(), 1e3 * cycle_s, kLeastRealTimeFactor, cure));
      break;
    case Pace::News::recovered:
      status.note("the world keeps up again: its clock runs at full speed");
      break;
  }
}

/// The world process in real time.
class RealtimeLoop : WorldLoop {
 public:
  explicit RealtimeLoop(const WorldRun& run)
      : WorldLoop(run),
        snapshots_(ports.snapshots, world),
        lead_(static_cast<std::uint64_t>(scheme_.lead_cycles)),
        first_cycle_s_(cycle_s(world.facts().stamp + lead_)),
        pace_(first_cycle_s_),
        newest_(user_count(), world.facts().stamp) {
    for (std::uint32_t u = 0; u < user_count(); ++u) users_.emplace_back(Peer{ProgramKind::haptic_sim, u});
  }

  Ending run() {
    const Scheduling scheduling = claim_realtime(priority::kWorld);
    fmt::print("world_sim: running at {:.1f} Hz, {}\n", 1.0 / first_cycle_s_, scheduling.text);
    std::fflush(stdout);
    if (!handshake()) return ending();
    measures.bodies().record_now(world);
    // The sub-worlds are ahead by the lead, and the world must wait for what they do.
    const double notice_s = scene.settings.remote ? kStartInBetweenHosts_s : kStartIn_s;
    const std::uint64_t stamp = world.facts().stamp;
    const std::uint64_t ahead_steps = world.timetable().start(stamp + lead_) - world.timetable().start(stamp);
    const double start_in_s = notice_s + scene.settings.h_s * static_cast<double>(ahead_steps);
    publish_frames(false, start_in_s, pace_.real_time_factor());
    PacedLoop<WorldStage> loop(Clock::now() + from_seconds(start_in_s), first_cycle_s_, Duration::zero(), stages_);
    measures.loop_begins(scheduling);
    while (!last_) step(loop);
    measures.loop_ends();
    measures.bodies().record_now(world);
    snapshots_.finish();
    close();
    checkpoints.finish(world);
    Ending ended = ending();
    ended.fault = fault_;
    if (all_gone()) ended.by = "fault";
    return ended;
  }

 private:
  /// Publishes standing frames until every haptic process has answered one: a reader that has only just been matched
  /// may miss the first ones. False when asked to stop.
  bool handshake() {
    std::vector<bool> answered(user_count(), false);
    const TimePoint until = Clock::now() + from_seconds(options.wait_s);
    TimePoint next = Clock::now();
    while (true) {
      for (std::size_t u = 0; u < user_count(); ++u) {
        while (ports.reports[u].take(report_) == Take::sample) {
          if (!ports.accept(u, report_)) continue;
          answered[u] = true;
          world.frame(u).echoed_sent_ns = report_.sent_ns;  // tells the round trip
        }
      }
      const auto missing = std::ranges::find(answered, false);
      if (missing == answered.end()) return true;
      if (stop_signal() != 0) return false;
      if (const std::string text = ports.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
      if (Clock::now() > until) {
        throw Error(ExitCode::failed, fmt::format("haptic_sim {} does not answer; is it stuck, or another network's?",
                                                  missing - answered.begin()));
      }
      if (Clock::now() >= next) {
        publish_frames(false, 0.0, 0.0);
        next = Clock::now() + from_seconds(0.05);
      }
      ports.bus->wait(0.01);
    }
  }

  void step(PacedLoop<WorldStage>& loop) {
    loop.wait();
    const double cycle_s = this->cycle_s(world.facts().stamp + lead_);
    pace_.begin(cycle_s);
    const double period_s = pace_.period_s();
    loop.shift(period_s - first_cycle_s_);  // the deadline of this cycle, on a slowed clock
    loop.wake(period_s);
    loop.begin();
    receive_reports(loop.woke());
    follow_orders();
    observe_users(loop.woke(), period_s);
    stages_.mark(WorldStage::control);
    last_ = stop_signal() != 0 || control_.stopped() || all_gone();
    if (control_.may_step() || last_) {
      simulate(loop, cycle_s, period_s);
    } else {
      stand(loop, cycle_s);
    }
  }

  /// Length of the cycle that begins at a stamp.
  [[nodiscard]] double cycle_s(std::uint64_t stamp) const {
    return scene.settings.h_s * world.timetable().ratio(stamp);
  }

  void receive_reports(TimePoint now) {
    for (std::size_t u = 0; u < user_count(); ++u) {
      while (take(ports.reports[u], report_, stages_) == Take::sample) {
        if (!ports.accept(u, report_)) {
          measures.refused_report();
          continue;
        }
        users_[u].heard(now);
        if (report_.stamp > newest_[u] + 1) measures.lost_report();
        newest_[u] = std::max(newest_[u], report_.stamp);
        if (!world.receive(std::move(report_))) measures.refused_report();
      }
    }
  }

  /// Announces users whose programs are gone: the world goes on for the others.
  void observe_users(TimePoint now, double period_s) {
    for (std::size_t u = 0; u < users_.size(); ++u) {
      const bool was_gone = users_[u].gone();
      users_[u].observe(ports.reports[u], ports.status, now, period_s);
      if (was_gone || !users_[u].gone()) continue;
      const std::string text = fmt::format("{}; user {} is no longer served from t = {:.3f} s on",
                                           users_[u].fault(ports.status), u, world.facts().time_s - kGone_s);
      fault_ += (fault_.empty() ? "" : "; ") + text;
      ports.status.note(text);
    }
  }
  [[nodiscard]] bool all_gone() const { return std::ranges::all_of(users_, &PeerWatch::gone); }

  /// A period of a paused world: the haptic processes hold their sub-worlds still meanwhile.
  void stand(PacedLoop<WorldStage>& loop, double cycle_s) {
    publish_frames(false, cycle_s, 0.0);
    ports.status.update(measures.state(world, 0.0));
    stages_.mark(WorldStage::send);
    loop.end(stages_.now());
    measures.end_cycle();
  }

  void simulate(PacedLoop<WorldStage>& loop, double cycle_s, double period_s) {
    world.step([this](WorldStage stage) { stages_.mark(stage); });
    last_ = last_ || world.facts().over;
    const TimePoint stepped = stages_.now(), deadline = loop.deadline();
    const double cost_s = to_seconds(stepped - loop.woke()) + publish_s_;
    world.took(cost_s);
    const double slip_s = pace_.cycle(cost_s, to_seconds(stepped - deadline) + publish_s_);
    loop.shift(slip_s);
    publish_frames(last_, to_seconds(loop.deadline() - Clock::now()), pace_.real_time_factor());
    const TimePoint end = stages_.mark(WorldStage::send);
    publish_s_ = to_seconds(end - stepped);
    const Miss miss = loop.judge(end, deadline);
    loop.end(end);
    const double wall_s = period_s + slip_s;
    measures.cycle(world, {to_seconds(end - loop.woke()), loop.lateness_s(), loop.woken_late_s(), miss},
                   cycle_s / wall_s, wall_s);
    if (pace_.stuck()) measures.stuck(wall_s);
    announce_pace(ports.status, pace_, cycle_s);
    yield_while_stuck();
    measures.bodies().record(world, to_seconds(loop.deadline() - Clock::now()));
    checkpoints.observe(world, to_seconds(end - loop.woke()));
    snapshots_.renew(world, pace_.real_time_factor());
    ports.status.update(measures.state(world, pace_.real_time_factor()));
    end_cycle();
  }

  /// A stuck world has no deadline that it could meet: threads without a priority get their share of the processor.
  void yield_while_stuck() {
    if (pace_.stuck() == yielding_) return;
    yielding_ = pace_.stuck();
    if (yielding_) {
      leave_realtime();
    } else {
      claim_realtime(priority::kWorld);
    }
  }

  BackgroundSnapshots snapshots_;
  std::uint64_t lead_;  ///< cycles by which the sub-worlds are ahead
  double first_cycle_s_;
  Pace pace_;
  std::vector<PeerWatch> users_;
  std::string fault_;                  ///< which users have gone
  std::vector<std::uint64_t> newest_;  ///< by user: the newest report's stamp
  double publish_s_ = 0.0;             ///< that publishing the frames of the cycle before took
  bool yielding_ = false;
  bool last_ = false;
};

}  // namespace

Ending run_realtime(const WorldRun& run) { return RealtimeLoop(run).run(); }

}  // namespace subworld
