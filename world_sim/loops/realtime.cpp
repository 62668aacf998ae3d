#include "model/error.hpp"
#include "program/peer_watch.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "world_sim/loops/loop.hpp"
#include "world_sim/loops/pace.hpp"
#include "world_sim/loops/snapshots.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kStartIn_s = 0.2;
constexpr double kHeld_s = 0.1;                 ///< without a report: the world no longer guesses, but holds the proxy
constexpr double kStartInBetweenHosts_s = 0.7;  ///< haptic clocks are ahead by the round trip

/// Announces when the world's clock slows, and when it is back at full speed.
void announce_pace(StatusBeacon& status, Pace& pace, double cycle_s) {
  const char* const cure = "cure: fewer bodies, a larger --ratio, --set world.preset=fast or a faster engine";
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
        pace_(first_cycle_s_) {
    for (std::uint32_t u = 0; u < user_count(); ++u)
      users_.push_back(
          {.peer = PeerWatch({ProgramKind::haptic_sim, u}, options.wait_s), .newest_stamp = world.facts().stamp});
  }

  Ending run() {
    const Scheduling scheduling = claim_realtime(priority::kWorld);
    fmt::print("world_sim: running at {:.1f} Hz, {}\n", 1.0 / first_cycle_s_, scheduling.text);
    std::fflush(stdout);
    if (!handshake()) return ending();
    measures.bodies().record_now(world);
    // The sub-worlds are ahead by the lead, and the world must wait for what they do.
    const double notice_s = scene.settings.has_unknown_delay() ? kStartInBetweenHosts_s : kStartIn_s;
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
    checkpoints.finish(world, measures.absences());
    Ending ended = ending();
    ended.fault = absent_at_end();
    if (all_gone()) ended.by = "fault";
    return ended;
  }

 private:
  /// Publishes standing frames until every awaited haptic process has answered one: a reader that has only just been
  /// matched may miss the first ones. Users who have not answered then are absent. False when asked to stop.
  bool handshake() {
    std::vector<bool> answered(user_count(), false);
    if (!answers(answered)) return false;
    for (std::size_t u = 0; u < user_count(); ++u) {
      if (answered[u]) {
        measures.returns(u, world.facts().time_s);
        continue;
      }
      world.begin_without(u);
      if (!measures.is_absent(u)) measures.leaves(u, world.facts().time_s, true);
      ports.status.note(fmt::format("the run begins without user {}, who may join later", u));
    }
    return true;
  }
  bool answers(std::vector<bool>& answered) {
    const TimePoint until = Clock::now() + from_seconds(options.wait_s);
    TimePoint next = Clock::now();
    while (true) {
      for (std::size_t u = 0; u < user_count(); ++u) {
        while (ports.reports[u].take(report_) == Take::sample) {
          if (!ports.belongs(u, report_)) continue;
          ports.serve(u, report_.sender);
          answered[u] = true;
          world.frame(u).echoed_sent_ns = report_.sent_ns;  // tells the round trip
        }
      }
      std::size_t missing = 0;
      while (missing < user_count() && (answered[missing] || !awaited[missing])) ++missing;
      if (missing == user_count()) return true;
      if (stop_signal() != 0) return false;
      if (const std::string text = ports.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
      if (Clock::now() > until) {
        throw Error(ExitCode::failed,
                    fmt::format("haptic_sim {} does not answer; is it stuck, or another network's?", missing));
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
    observe_users(loop.woke(), period_s, cycle_s);
    check_replaced(loop.woke());
    stages_.mark(WorldStage::control);
    last_ = stop_signal() != 0 || control_.stopped() || all_gone();
    const bool stood = std::exchange(stands_, !control_.may_step() && !last_);
    if (!stands_) {
      if (stood) loop.shift(std::max(0.0, loop.lateness_s()));  // lateness of the pause is not caught up with
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
        if (!ports.belongs(u, report_)) {
          measures.refused_report();
          continue;
        }
        use_report(u, now);
      }
    }
  }

  /// A world that was halted may have been replaced meanwhile. Throws `Error` (failed) where another world has shown
  /// up, and no user takes part in this one any more.
  void check_replaced(TimePoint now) {
    if (ports.other_worlds() != other_worlds_) another_since_ = now;
    other_worlds_ = ports.other_worlds();
    if (another_since_ == TimePoint{}) return;
    for (std::size_t u = 0; u < users_.size(); ++u) {
      // Reports from before the halt are used up at once.
      if (users_[u].peer.last_heard() > another_since_ + from_seconds(kHeld_s)) another_since_ = {};
      if (!world.user_facts(u).absent) return;
    }
    if (another_since_ == TimePoint{}) return;
    throw Error(ExitCode::failed,
                fmt::format("another world_sim serves the users of this one, which was halted or cut off for a time: "
                            "this one ends at t = {:.3f} s",
                            world.facts().time_s));
  }

  void use_report(std::size_t u, TimePoint now) {
    User& user = users_[u];
    const std::uint64_t stamp = report_.stamp, sender = report_.sender;
    if (dismisses(u)) return;  // it fades the force and ends
    const bool absent = world.user_facts(u).absent;
    if (!world.receive(std::move(report_))) {
      // One of an absent user was on its way when the user left.
      if (!absent) measures.refused_report();
      return;
    }
    ports.serve(u, sender);
    user.peer.heard(now);
    user.quiet_s = 0.0;
    if (!absent && stamp > user.newest_stamp + 1) measures.lost_report();
    user.newest_stamp = absent ? stamp : std::max(user.newest_stamp, stamp);
    if (absent) returns(u);
  }

  /// Notes who is absent: the world goes on for the others.
  void observe_users(TimePoint now, double period_s, double cycle_s) {
    for (std::size_t u = 0; u < users_.size(); ++u) {
      User& user = users_[u];
      user.peer.observe(ports.reports[u], ports.status, now, period_s);
      if (dismisses(u) && !world.user_facts(u).absent) leaves(u, true);
      if (control_.paused()) continue;
      user.quiet_s += cycle_s;
      if (user.quiet_s > std::max(kHeld_s, 3.0 * cycle_s)) world.hold(u);
      if (user.quiet_s > std::max(kAbsent_s, 4.0 * cycle_s) && !world.user_facts(u).absent) leaves(u, false);
    }
  }
  void leaves(std::size_t u, bool by_order) {
    const double from_s = world.facts().time_s - (by_order ? 0.0 : users_[u].quiet_s);
    world.leave(u);
    ports.release(u);
    measures.leaves(u, from_s, by_order);
    ports.status.note(by_order
                          ? fmt::format("user {} has left at t = {:.3f} s, by order", u, from_s)
                          : fmt::format("user {} is absent from t = {:.3f} s on: no message of haptic_sim {} since; "
                                        "the world holds its proxy and goes on",
                                        u, from_s, u));
  }
  void returns(std::size_t u) {
    measures.returns(u, world.facts().time_s);
    ports.status.note(fmt::format("user {} takes part from t = {:.3f} s on", u, world.facts().time_s));
  }
  [[nodiscard]] bool all_gone() const {
    return std::ranges::all_of(users_, [](const User& user) { return user.peer.gone(); });
  }
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
    checkpoints.observe(world, measures.absences(), to_seconds(end - loop.woke()));
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
  struct User {
    PeerWatch peer;
    double quiet_s = 0.0;            ///< simulated time since the newest report came
    std::uint64_t newest_stamp = 0;  ///< of the reports that came
  };
  std::vector<User> users_;
  std::uint64_t other_worlds_ = 0;  ///< that have shown up
  TimePoint another_since_;         ///< the newest of them has, and no user has reported since; {}: none
  double publish_s_ = 0.0;          ///< that publishing the frames of the cycle before took
  bool yielding_ = false;
  bool stands_ = false;  ///< paused
  bool last_ = false;
};

}  // namespace

Ending run_realtime(const WorldRun& run) { return RealtimeLoop(run).run(); }

}  // namespace subworld
