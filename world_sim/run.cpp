#include "world_sim/run.hpp"

#include "coupling/delay.hpp"
#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/lateness.hpp"
#include "rt/presence.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "world_sim/pace.hpp"
#include "world_sim/run_control.hpp"
#include "world_sim/snapshots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr double kStartIn_s = 0.2;
constexpr double kLastReport_s = 0.3;    ///< that a report may take after the world was asked to stop
constexpr double kAcknowledged_s = 0.5;  ///< that the last frames may take to arrive, all users together

/// Whether the scene's duration is over, to the nearest cycle.
bool over(const World& world, const Settings& settings) {
  const double next_s = settings.h_s * world.timetable().ratio(world.stamp());
  return world.time_s() + 0.5 * next_s > settings.duration_s;
}

/// World::step(), each part of it to its stage.
void step(World& world, Stages<WorldStage>& stages) {
  world.synchronise();
  stages.mark(WorldStage::synchronise);
  world.simulate();
  stages.mark(WorldStage::simulate);
  world.account();
  stages.mark(WorldStage::account);
  world.make_frames();
  stages.mark(WorldStage::extract);
}

void publish_frames(WorldPorts& ports, World& world, bool last, double start_in_s, double real_time_factor) {
  for (std::size_t u = 0; u < world.user_count(); ++u) {
    if (!last && !world.tells(u)) continue;
    WorldFrame& frame = world.frame(u);
    frame.session = ports.session;
    frame.served = ports.served[u];
    frame.last = last;
    frame.start_in_s = start_in_s;
    frame.real_time_factor = real_time_factor;
    ports.frames[u].write(frame);
  }
}

void check_finite(const World& world) {
  if (world.finite()) return;
  throw Error(ExitCode::failed,
              fmt::format("the world is no longer finite at t = {:.3f} s; use a smaller step or the preset quality",
                          world.time_s()));
}

void take_orders(WorldPorts& ports, RunControl& run_control, World& world, EngineExchange& exchange) {
  Control order;
  while (ports.control.take(order) == Take::sample) {
    if (order.verb != ControlVerb::set_engine) {
      ports.status.answer(order.number, run_control.follow(order));
      continue;
    }
    const auto wanted = parse_engine_order(order);
    if (wanted && wanted->target != EngineOrder::Target::world) continue;
    ports.status.answer(order.number, wanted ? world.change_engine(exchange, *wanted)
                                             : "refused: unknown engine order \"" + order.argument + "\"");
  }
}

/// Hands over to the engine that was asked for, once it is ready.
void exchange_engine(WorldPorts& ports, World& world, EngineExchange& exchange, WorldMeasures& measures) {
  const std::string before(world.engine().name());
  const TimePoint begin = Clock::now();
  if (world.exchange_engine(exchange)) {
    const EngineChange change{exchange.order(), world.time_s(), before, std::string(world.engine().name()),
                              to_seconds(Clock::now() - begin)};
    measures.engine_changed(change);
    ports.status.answer(change.order, to_text(change));
  }
  if (const std::string failure = exchange.take_failure(); !failure.empty()) {
    ports.status.answer(exchange.order(), "refused: " + failure);
  }
}

/// Two worlds in one domain are one too many. Throws `Error` (usage) where this one has not begun yet.
void refuse_second_world(WorldPorts& ports) {
  if (const std::string text = ports.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
}

/// The one that runs goes on, and says so.
void tell_of_second_world(WorldPorts& ports) {
  if (const std::string text = ports.second_world(); !text.empty()) ports.status.note(text);
}

/// Publishes standing frames until every haptic process has answered one: a reader that has only just been matched may
/// miss what comes first. False when asked to stop.
bool handshake(WorldPorts& ports, World& world, double wait_s) {
  HapticReport report;
  std::vector<bool> answered(world.user_count(), false);
  const TimePoint until = Clock::now() + from_seconds(wait_s);
  TimePoint next = Clock::now();
  while (true) {
    for (std::size_t u = 0; u < world.user_count(); ++u) {
      while (ports.reports[u].take(report) == Take::sample) answered[u] = answered[u] || ports.accept(u, report);
    }
    const auto silent = std::find(answered.begin(), answered.end(), false);
    if (silent == answered.end()) return true;
    if (stop_signal() != 0) return false;
    refuse_second_world(ports);
    if (Clock::now() > until) {
      throw Error(ExitCode::failed, fmt::format("haptic_sim {} does not answer; is it stuck, or another network's?",
                                                silent - answered.begin()));
    }
    if (Clock::now() >= next) {
      publish_frames(ports, world, false, 0.0, 0.0);
      next = Clock::now() + from_seconds(0.05);
    }
    ports.bus->wait(0.01);
  }
}

/// Tells users when the world's clock slows, and when it is back at full speed.
void tell_pace(WorldPorts& ports, Pace& pace, double cycle_s) {
  const char* const cure = "cure: fewer bodies, a larger --ratio, --preset fast or a faster engine";
  switch (pace.take_news()) {
    case Pace::News::none:
      break;
    case Pace::News::slowed:
      ports.status.note(fmt::format("the world needs {:.1f} ms of a {:g} ms cycle: its clock runs at {:.2f}; {}",
                                    1e3 * pace.cost_s(), 1e3 * cycle_s, pace.real_time_factor(), cure));
      break;
    case Pace::News::stuck:
      ports.status.note(
          fmt::format("the world needs {:.0f} ms of a {:g} ms cycle, more than its slowest clock ({:g}) "
                      "gives it: it stops and goes; {}",
                      1e3 * pace.cost_s(), 1e3 * cycle_s, kLeastRealTimeFactor, cure));
      break;
    case Pace::News::recovered:
      ports.status.note("the world keeps up again: its clock runs at full speed");
      break;
  }
}

Ending ending_of(const WorldPorts& ports, const World& world, const RunControl& run_control, const Settings& settings) {
  return {.session = ports.session,
          .to_s = world.time_s(),
          .by = over(world, settings)   ? "duration"
                : run_control.stopped() ? "control"
                                        : name_of_signal(stop_signal()),
          .fault = {}};
}

/// Who is still there, in real time: the world goes on for those.
class Users {
 public:
  explicit Users(std::size_t count) : heard_(count, false), there_(count) {}

  void hear(std::size_t user) { heard_[user] = true; }
  /// Once a cycle. Says who has gone.
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

void acknowledge(WorldPorts& ports) {
  const TimePoint until = Clock::now() + from_seconds(kAcknowledged_s);
  for (auto& frames : ports.frames) frames.wait_for_acknowledgments(std::max(0.0, to_seconds(until - Clock::now())));
}

}  // namespace

bool await_peers(WorldPorts& ports, const Options& options) {
  ports.status.enter("waiting");
  const TimePoint until = Clock::now() + from_seconds(options.wait_s);
  const auto wait_for = [&](const auto& there, const std::string& missing, const std::string& cure) {
    while (!there()) {
      if (stop_signal() != 0) return false;
      if (Clock::now() > until) {
        throw Error(
            ExitCode::failed,
            fmt::format("{} on domain {} within {} s; start {} with the same --domain; on another host, name it "
                        "with --peers and give --interface on both",
                        missing, options.network.domain, options.wait_s, cure));
      }
      ports.bus->wait(0.05);
    }
    return true;
  };
  for (std::size_t u = 0; u < ports.frames.size(); ++u) {
    const auto there = [&] { return ports.frames[u].matched() > 0 && ports.reports[u].matched() > 0; };
    if (!wait_for(there, fmt::format("user {}: no haptic_sim", u), fmt::format("haptic_sim --user {}", u)))
      return false;
  }
  if (options.await_display) {
    // What only looks may hold up a run, but does not end it.
    const auto looks = [&] { return ports.snapshots.matched() > 0; };
    const auto may_wait = [&] { return stop_signal() == 0 && Clock::now() < until; };
    while (!looks() && may_wait()) ports.bus->wait(0.05);
    if (!looks()) ports.status.note("no display has come: the run goes on without one");
    // One that holds the scene has found this world's other topics too; one that has died never will.
    while (looks() && may_wait() && !ports.scene.wait_for_acknowledgments(0.1)) {
    }
    if (stop_signal() != 0) return false;
  }
  // Who has found the others' endpoints by now has found another world's too.
  refuse_second_world(ports);
  ports.status.enter("running");
  return true;
}

Ending run_lockstep(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                    const Scene& scene) {
  TimePoint asked{};
  // Asked to stop, it still waits a little: a report that comes lets everybody end in order.
  const auto gives_up = [&] {
    if (stop_signal() == 0) return false;
    if (asked == TimePoint{}) asked = Clock::now();
    return to_seconds(Clock::now() - asked) > kLastReport_s;
  };
  Stages<WorldStage>& stages = measures.stages();
  Snapshots snapshots(ports.snapshots);
  WorldView view;
  HapticReport report;
  reserve(report, kUsualMembers);
  std::vector<std::uint64_t> next(world.user_count(), 0);
  /// False when asked to stop and a report does not come.
  const auto receive_due = [&] {
    for (std::size_t u = 0; u < world.user_count(); ++u) {
      const Delay delay(scene.settings, world.scheme().lead_cycles(), static_cast<std::uint32_t>(u));
      for (; delay.report_due(next[u], world.stamp(), world.timetable()); ++next[u]) {
        if (world.has_report(u, next[u])) continue;
        const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(u)};
        const auto ours = [&](const HapticReport& came) { return ports.accept(u, came); };
        if (!await(*ports.bus, ports.status, ports.reports[u], report, stages, haptic, ours, gives_up)) return false;
        if (!world.receive(std::move(report)) || !world.has_report(u, next[u])) {
          throw Error(ExitCode::failed, fmt::format("haptic_sim {} sent a report out of turn at stamp {}; are two of "
                                                    "them on this domain?",
                                                    u, world.stamp()));
        }
      }
    }
    return true;
  };

  RunControl run_control;
  publish_frames(ports, world, false, 0.0, 1.0);
  bool last = false;
  stages.begin();
  while (!last) {
    if (!receive_due()) {
      publish_frames(ports, world, true, 0.0, 1.0);
      break;
    }
    tell_of_second_world(ports);
    take_orders(ports, run_control, world, exchange);
    while (!run_control.may_step() && !run_control.stopped() && stop_signal() == 0) {
      ports.bus->wait(0.05);
      take_orders(ports, run_control, world, exchange);
      exchange_engine(ports, world, exchange, measures);
    }
    exchange_engine(ports, world, exchange, measures);
    const TimePoint begin = stages.mark(WorldStage::control);
    step(world, stages);
    // A stop takes effect between cycles, and as a last frame: so everybody ends in order.
    last = over(world, scene.settings) || stop_signal() != 0 || run_control.stopped();
    publish_frames(ports, world, last, 0.0, 1.0);
    measures.cycle(world, {to_seconds(stages.mark(WorldStage::send) - begin)}, 1.0, 0.0);
    measures.bodies().record(world, std::numeric_limits<double>::infinity());
    if (snapshots.wanted(world.time_s()) || last) {
      world.look(view);
      snapshots.publish(view, last);
    }
    ports.status.update(measures.state(world, 1.0));
    stages.mark(WorldStage::display);
    measures.end_cycle();
    check_finite(world);
  }
  measures.bodies().record_now(world);
  if (world.scheme().border() != Border::none && receive_due()) world.synchronise();
  world.close();
  acknowledge(ports);
  return ending_of(ports, world, run_control, scene.settings);
}

Ending run_realtime(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                    const Scene& scene, double wait_s) {
  const double h = scene.settings.h_s;
  // The sub-worlds are ahead by so much, and the world must wait for what they do.
  const auto lead = static_cast<std::uint64_t>(world.scheme().lead_cycles());
  const double first_cycle_s = h * world.timetable().ratio(lead);
  const Scheduling scheduling = claim_realtime(priority::kWorld);
  fmt::print("world_sim: running at {:.1f} Hz, {}\n", 1.0 / first_cycle_s, scheduling.text);
  std::fflush(stdout);

  Stages<WorldStage>& stages = measures.stages();
  BackgroundSnapshots snapshots(ports.snapshots, world);
  RunControl run_control;
  HapticReport report;
  reserve(report, kUsualMembers);
  std::vector<std::uint64_t> newest(world.user_count(), 0);
  Pace pace(first_cycle_s);
  double publish_s = 0.0;  // of the frames of the cycle before
  bool yielding = false;
  Users users(world.user_count());
  bool last = false;
  if (!handshake(ports, world, wait_s)) return ending_of(ports, world, run_control, scene.settings);
  const double start_in_s = kStartIn_s + h * static_cast<double>(world.timetable().start(lead));
  publish_frames(ports, world, false, start_in_s, pace.real_time_factor());
  Cyclic loop(Clock::now() + from_seconds(start_in_s), from_seconds(first_cycle_s));
  Lateness lateness(thread_use());
  measures.loop_begins(scheduling);
  while (!last) {
    const TimePoint asked = Clock::now();
    const double lateness_s = to_seconds(loop.wait());
    const double cycle_s = h * world.timetable().ratio(world.stamp() + lead);
    pace.begin(cycle_s);
    const double period_s = pace.period_s();
    loop.shift(from_seconds(period_s - first_cycle_s));  // the deadline of this cycle, on a slowed clock
    const TimePoint begin = Clock::now();
    lateness.begin(loop.released(), asked, begin, from_seconds(period_s));
    stages.begin(loop.released(), begin);
    for (std::size_t u = 0; u < world.user_count(); ++u) {
      while (take(ports.reports[u], report, stages) == Take::sample) {
        if (!ports.accept(u, report)) {
          measures.refused_report();
          continue;
        }
        users.hear(u);
        if (report.stamp > newest[u] + 1) measures.lost_report();
        newest[u] = std::max(newest[u], report.stamp);
        if (!world.receive(std::move(report))) measures.refused_report();
      }
    }
    tell_of_second_world(ports);
    take_orders(ports, run_control, world, exchange);
    exchange_engine(ports, world, exchange, measures);
    users.observe(ports, world.time_s(), period_s);
    stages.mark(WorldStage::control);
    last = stop_signal() != 0 || run_control.stopped() || users.all_gone();
    if (!run_control.may_step() && !last) {
      // The haptic processes hold their sub-worlds still while the world's clock stands.
      publish_frames(ports, world, false, cycle_s, 0.0);
      ports.status.update(measures.state(world, 0.0));
      stages.mark(WorldStage::send);
      lateness.end(stages.now(), thread_use());
      measures.end_cycle();
      continue;
    }
    step(world, stages);
    last = last || over(world, scene.settings);
    const TimePoint stepped = stages.now();
    world.took(to_seconds(stepped - begin) + publish_s);
    const TimePoint deadline = loop.deadline();
    const double slip_s =
        pace.cycle(to_seconds(stepped - begin) + publish_s, to_seconds(stepped - deadline) + publish_s);
    loop.shift(from_seconds(slip_s));
    publish_frames(ports, world, last, to_seconds(loop.deadline() - Clock::now()), pace.real_time_factor());
    const TimePoint end = stages.mark(WorldStage::send);
    publish_s = to_seconds(end - stepped);
    const ThreadUse use = thread_use();
    const Miss miss = lateness.judge(end, deadline, use);
    lateness.end(end, use);
    const double wall_s = period_s + slip_s;
    measures.cycle(world, {to_seconds(end - begin), lateness_s, lateness.woken_late_s(), miss}, cycle_s / wall_s,
                   wall_s);
    if (pace.stuck()) measures.stuck(wall_s);
    tell_pace(ports, pace, cycle_s);
    if (pace.stuck() != yielding) {
      // It has no deadline left that it could meet: the threads without a priority get their share of the processor.
      yielding = pace.stuck();
      if (yielding) {
        leave_realtime();
      } else {
        claim_realtime(priority::kWorld);
      }
    }
    measures.bodies().record(world, to_seconds(loop.deadline() - Clock::now()));
    snapshots.renew(world, pace.real_time_factor());
    ports.status.update(measures.state(world, pace.real_time_factor()));
    stages.mark(WorldStage::display);
    measures.end_cycle();
    check_finite(world);
  }
  measures.loop_ends();
  measures.bodies().record_now(world);
  snapshots.finish();
  world.close();
  acknowledge(ports);
  Ending ending = ending_of(ports, world, run_control, scene.settings);
  ending.fault = users.fault();
  if (users.all_gone()) ending.by = "fault";
  return ending;
}

}  // namespace subworld
