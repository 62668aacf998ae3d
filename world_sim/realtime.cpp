#include "model/error.hpp"
#include "rt/paced_loop.hpp"
#include "rt/presence.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "world_sim/cycle.hpp"
#include "world_sim/pace.hpp"
#include "world_sim/run.hpp"
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

/// Which users are still there: the world goes on for those.
class Users {
 public:
  explicit Users(std::size_t count) : heard_(count, false), there_(count) {}

  void hear(std::size_t user) { heard_[user] = true; }
  /// Once a cycle. Announces users whose programs are gone.
  void observe(WorldPorts& ports, double time_s, double period_s) {
    for (std::size_t u = 0; u < there_.size(); ++u) {
      const bool was_gone = there_[u].gone();
      const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(u)};
      there_[u].observe(heard_[u], alive(ports.reports[u], ports.status, haptic), period_s);
      heard_[u] = false;
      if (was_gone || !there_[u].gone()) continue;
      const std::string text =
          fmt::format("{}; user {} is no longer served from t = {:.3f} s on",
                      gone_text(ProgramKind::haptic_sim, static_cast<std::uint32_t>(u)), u, time_s - kGone_s);
      fault_ += (fault_.empty() ? "" : "; ") + text;
      ports.status.note(text);
    }
  }
  [[nodiscard]] bool all_gone() const {
    return std::ranges::all_of(there_, [](const Presence& user) { return user.gone(); });
  }
  [[nodiscard]] const std::string& fault() const noexcept { return fault_; }

 private:
  std::vector<bool> heard_;  ///< a report, since the last cycle
  std::vector<Presence> there_;
  std::string fault_;
};

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
class RealtimeLoop {
 public:
  RealtimeLoop(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange, const Scene& scene)
      : ports_(ports),
        world_(world),
        measures_(measures),
        stages_(measures.stages()),
        cycle_(ports, world, measures, exchange),
        snapshots_(ports.snapshots, world),
        h_s_(scene.settings.h_s),
        lead_(static_cast<std::uint64_t>(world.scheme().properties.lead_cycles)),
        first_cycle_s_(h_s_ * world.timetable().ratio(lead_)),
        pace_(first_cycle_s_),
        users_(world.user_count()),
        newest_(world.user_count(), 0) {
    reserve(report_, kUsualMembers);
  }

  [[nodiscard]] double first_cycle_s() const noexcept { return first_cycle_s_; }

  Ending run(const Scheduling& scheduling, double wait_s) {
    if (!handshake(wait_s)) return cycle_.ending();
    // The sub-worlds are ahead by the lead, and the world must wait for what they do.
    const double start_in_s = kStartIn_s + h_s_ * static_cast<double>(world_.timetable().start(lead_));
    cycle_.publish_frames(false, start_in_s, pace_.real_time_factor());
    PacedLoop<WorldStage> loop(Clock::now() + from_seconds(start_in_s), first_cycle_s_, Duration::zero(), stages_);
    measures_.loop_begins(scheduling);
    while (!last_) step(loop);
    measures_.loop_ends();
    measures_.bodies().record_now(world_);
    snapshots_.finish();
    cycle_.close();
    Ending ending = cycle_.ending();
    ending.fault = users_.fault();
    if (users_.all_gone()) ending.by = "fault";
    return ending;
  }

 private:
  /// Publishes standing frames until every haptic process has answered one: a reader that has only just been matched
  /// may miss the first ones. False when asked to stop.
  bool handshake(double wait_s) {
    std::vector<bool> answered(world_.user_count(), false);
    const TimePoint until = Clock::now() + from_seconds(wait_s);
    TimePoint next = Clock::now();
    while (true) {
      for (std::size_t u = 0; u < world_.user_count(); ++u) {
        while (ports_.reports[u].take(report_) == Take::sample) answered[u] = answered[u] || ports_.accept(u, report_);
      }
      const auto missing = std::ranges::find(answered, false);
      if (missing == answered.end()) return true;
      if (stop_signal() != 0) return false;
      if (const std::string text = ports_.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
      if (Clock::now() > until) {
        throw Error(ExitCode::failed, fmt::format("haptic_sim {} does not answer; is it stuck, or another network's?",
                                                  missing - answered.begin()));
      }
      if (Clock::now() >= next) {
        cycle_.publish_frames(false, 0.0, 0.0);
        next = Clock::now() + from_seconds(0.05);
      }
      ports_.bus->wait(0.01);
    }
  }

  void step(PacedLoop<WorldStage>& loop) {
    loop.wait();
    const double cycle_s = h_s_ * world_.timetable().ratio(world_.stamp() + lead_);
    pace_.begin(cycle_s);
    const double period_s = pace_.period_s();
    loop.shift(period_s - first_cycle_s_);  // the deadline of this cycle, on a slowed clock
    loop.wake(period_s);
    loop.begin();
    receive_reports();
    cycle_.follow_orders();
    users_.observe(ports_, world_.time_s(), period_s);
    stages_.mark(WorldStage::control);
    last_ = stop_signal() != 0 || cycle_.control().stopped() || users_.all_gone();
    if (cycle_.control().may_step() || last_) {
      simulate(loop, cycle_s, period_s);
    } else {
      stand(loop, cycle_s);
    }
  }

  void receive_reports() {
    for (std::size_t u = 0; u < world_.user_count(); ++u) {
      while (take(ports_.reports[u], report_, stages_) == Take::sample) {
        if (!ports_.accept(u, report_)) {
          measures_.refused_report();
          continue;
        }
        users_.hear(u);
        if (report_.stamp > newest_[u] + 1) measures_.lost_report();
        newest_[u] = std::max(newest_[u], report_.stamp);
        if (!world_.receive(std::move(report_))) measures_.refused_report();
      }
    }
  }

  /// A period of a paused world: the haptic processes hold their sub-worlds still meanwhile.
  void stand(PacedLoop<WorldStage>& loop, double cycle_s) {
    cycle_.publish_frames(false, cycle_s, 0.0);
    ports_.status.update(measures_.state(world_, 0.0));
    stages_.mark(WorldStage::send);
    loop.end(stages_.now());
    measures_.end_cycle();
  }

  void simulate(PacedLoop<WorldStage>& loop, double cycle_s, double period_s) {
    cycle_.step();
    last_ = last_ || world_.over();
    const TimePoint stepped = stages_.now(), deadline = loop.deadline();
    const double cost_s = to_seconds(stepped - loop.woke()) + publish_s_;
    world_.took(cost_s);
    const double slip_s = pace_.cycle(cost_s, to_seconds(stepped - deadline) + publish_s_);
    loop.shift(slip_s);
    cycle_.publish_frames(last_, to_seconds(loop.deadline() - Clock::now()), pace_.real_time_factor());
    const TimePoint end = stages_.mark(WorldStage::send);
    publish_s_ = to_seconds(end - stepped);
    const Miss miss = loop.judge(end, deadline);
    loop.end(end);
    const double wall_s = period_s + slip_s;
    measures_.cycle(world_, {to_seconds(end - loop.woke()), loop.lateness_s(), loop.woken_late_s(), miss},
                    cycle_s / wall_s, wall_s);
    if (pace_.stuck()) measures_.stuck(wall_s);
    announce_pace(ports_.status, pace_, cycle_s);
    yield_while_stuck();
    measures_.bodies().record(world_, to_seconds(loop.deadline() - Clock::now()));
    snapshots_.renew(world_, pace_.real_time_factor());
    ports_.status.update(measures_.state(world_, pace_.real_time_factor()));
    stages_.mark(WorldStage::display);
    measures_.end_cycle();
    cycle_.check_finite();
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

  WorldPorts& ports_;
  World& world_;
  WorldMeasures& measures_;
  Stages<WorldStage>& stages_;
  WorldCycle cycle_;
  BackgroundSnapshots snapshots_;
  double h_s_;
  std::uint64_t lead_;  ///< cycles by which the sub-worlds are ahead
  double first_cycle_s_;
  Pace pace_;
  Users users_;
  std::vector<std::uint64_t> newest_;  ///< by user: the newest report's stamp
  HapticReport report_;
  double publish_s_ = 0.0;  ///< that publishing the frames of the cycle before took
  bool yielding_ = false;
  bool last_ = false;
};

}  // namespace

Ending run_realtime(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                    const Scene& scene, double wait_s) {
  RealtimeLoop loop(ports, world, measures, exchange, scene);
  const Scheduling scheduling = claim_realtime(priority::kWorld);
  fmt::print("world_sim: running at {:.1f} Hz, {}\n", 1.0 / loop.first_cycle_s(), scheduling.text);
  std::fflush(stdout);
  return loop.run(scheduling, wait_s);
}

}  // namespace subworld
