#include "haptic_sim/run.hpp"

#include "coupling/delay.hpp"
#include "haptic_sim/phase.hpp"
#include "model/error.hpp"
#include "rt/arrears.hpp"
#include "rt/dilation.hpp"
#include "rt/lateness.hpp"
#include "rt/presence.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

namespace subworld {

namespace {

constexpr double kStale_s = 0.005;           ///< without a device state: the force fades out
constexpr double kLongSleep_s = 0.05;        ///< longer than a device needs to fade out without commands
constexpr double kAlone_s = 0.25;            ///< without a frame: the world has gone or stands
constexpr int kFadeSteps = 30;               ///< before the last command, so that a hand is let go gently
constexpr int kTimesLast = 5;                ///< the last command is sent in real time
constexpr double kLastAcknowledged_s = 1.0;  ///< that the last command may take to arrive on a busy machine
constexpr std::chrono::milliseconds kLastAgain{5};
constexpr std::uint64_t kFarAhead = 10'000;  ///< cycles after the newest frame: no world skips so many
constexpr std::size_t kMostWaiting = 16;     ///< frames ahead of the sub-world
constexpr std::uint64_t kTooFarBehind = 8;   ///< cycles; then the sub-world starts again from the world's states

/// More than once where one may get lost.
void send_last(HapticPorts& ports, const DeviceState& state, int times) {
  DeviceCommand command;
  command.device = state.device;
  command.session = ports.session;
  command.served = state.sender;
  command.sequence = state.sequence;
  command.pose = state.pose;
  command.last = true;
  for (int i = 0; i < times; ++i) {
    if (i > 0) std::this_thread::sleep_for(kLastAgain);
    ports.command.write(command);
  }
  ports.command.wait_for_acknowledgments(kLastAcknowledged_s);
}

/// Follows the order to change the sub-world's engine, between two steps and without waiting.
class EngineOrders {
 public:
  EngineOrders(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange)
      : ports_(ports), sub_(sub), measures_(measures), exchange_(exchange) {}

  void follow() {
    while (ports_.control.take(order_) == Take::sample) {
      if (order_.verb != ControlVerb::set_engine) continue;
      const auto wanted = parse_engine_order(order_);
      if (!wanted || wanted->target != EngineOrder::Target::haptic) continue;
      ports_.status.answer(order_.number, sub_.change_engine(exchange_, *wanted));
    }
    const std::string before = sub_.engine_name();
    const TimePoint begin = Clock::now();
    if (sub_.exchange_engine(exchange_)) {
      measures_.engine_changed(
          {exchange_.order(), sub_.time_s(), before, sub_.engine_name(), to_seconds(Clock::now() - begin)});
    }
    if (const std::string failure = exchange_.take_failure(); !failure.empty()) {
      ports_.status.answer(exchange_.order(), "refused: " + failure);
    }
    if (const auto change = measures_.take_settled_change()) {
      ports_.status.answer(change->order, fmt::format("{}; force steps {:.3f} N, before {:.3f} N", to_text(*change),
                                                      change->force_step_n, change->force_step_before_n));
    }
  }

 private:
  HapticPorts& ports_;
  SubWorld& sub_;
  HapticMeasures& measures_;
  EngineExchange& exchange_;
  Control order_;
};

}  // namespace

Ending run_lockstep(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                    const Scene& scene) {
  EngineOrders orders(ports, sub, measures, exchange);
  const double h = scene.settings.h_s;
  const auto stopped = [] { return stop_signal() != 0; };
  Stages<HapticStage>& stages = measures.stages();
  const auto user = static_cast<std::uint32_t>(sub.user());
  const Peer world_sim{ProgramKind::world_sim, 0}, device_sim{ProgramKind::device_sim, user};
  DeviceState device;
  WorldFrame frame;
  reserve(frame, kUsualMembers);
  Ending ending{.session = ports.session, .from_s = sub.time_s(), .by = "last frame"};
  const auto send_report = [&] {
    HapticReport* const report = sub.close_cycle(to_ns(Clock::now()));
    if (report != nullptr && !ports.send(*report))
      throw Error(ExitCode::failed, unsent_text("haptic_report", ports.frames, ports.status, world_sim));
    stages.mark(HapticStage::report);
  };

  const Delay delay(scene.settings, sub.scheme().properties.lead_cycles, user);
  DelayLine<DeviceState> states(scene.settings, Direction::from_device, user);
  DelayLine<DeviceCommand> commands(scene.settings, Direction::to_device, user);
  std::uint64_t step = 0;
  std::uint64_t next_frame = 1;
  bool last = false;
  /// Takes the frames that are due now. False after the last one, or when asked to stop.
  const auto follow_world = [&] {
    for (; delay.frame_due(next_frame, sub.timetable()) <= step; ++next_frame) {
      if (sub.passes_frame(next_frame)) continue;
      const auto ours = [&](const WorldFrame& came) { return came.session == ports.session; };
      if (!await(*ports.bus, ports.status, ports.frames, frame, stages, world_sim, ours, stopped)) return false;
      if (ports.refused_by(frame)) throw Error(ExitCode::failed, refused_text(user));
      const TimePoint begin = stages.now();
      if (frame.echoed_sent_ns != 0)
        measures.round_trip(1e-9 * static_cast<double>(to_ns(begin) - frame.echoed_sent_ns));
      last = frame.last;
      const std::uint64_t lost = sub.apply(frame);
      measures.synchronised(to_seconds(stages.mark(HapticStage::synchronise) - begin), lost);
      if (last) return false;
    }
    return true;
  };

  std::uint64_t held = 0;  // the device that the first state came from
  stages.begin();
  if (sub.reports_at_start()) send_report();
  while (follow_world()) {
    const auto ours = [&](const DeviceState& came) {
      return came.session == ports.session && (held == 0 || came.sender == held);
    };
    if (!await(*ports.bus, ports.status, ports.device, device, stages, device_sim, ours, stopped)) break;
    held = device.sender;
    ports.device.trust_sender();
    orders.follow();
    const TimePoint begin = stages.mark(HapticStage::control);
    const DeviceState& known = states.pass(device, step);
    const FeltStep felt = sub.feel(known, true, h);
    DeviceCommand command = commands.pass(sub.command_for(known, felt.to_operator), step);
    command.sequence = device.sequence;  // each step of the device waits for its own answer
    command.echoed_sent_ns = device.sent_ns;
    stages.mark(HapticStage::feel);
    if (!ports.command.write(command)) {
      throw Error(ExitCode::failed, unsent_text("device_command", ports.device, ports.status, device_sim));
    }
    stages.mark(HapticStage::send);
    if (sub.report_due()) send_report();
    sub.advance(h);
    measures.step(sub, felt, {to_seconds(stages.mark(HapticStage::advance) - begin)});
    ++step;
    if (!sub.finite())
      throw Error(ExitCode::failed, "the sub-world is no longer finite; use a smaller h_s or the preset quality");
    ports.status.update(measures.state(sub.time_s()));
    stages.mark(HapticStage::account);
    if (sub.report_due()) send_report();
    measures.end_step();
  }
  ending.to_s = sub.time_s();
  if (last) {
    send_last(ports, device, 1);
    ports.reports.wait_for_acknowledgments(1.0);
  } else {
    ending.by = name_of_signal(stop_signal());
  }
  return ending;
}

Ending run_realtime(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                    const Scene& scene, const FirstFrame& first, Duration spin) {
  EngineOrders orders(ports, sub, measures, exchange);
  const double h = scene.settings.h_s;
  const double longest_cycle_s = scene.settings.longest_cycle_s();
  const double device_period_s = 1.0 / scene.users[sub.user()].device.rate_hz;
  const Scheduling scheduling = claim_realtime(priority::kHaptic);
  fmt::print("haptic_sim {}: {:.0f} Hz, {}\n", sub.user(), 1.0 / h, scheduling.text);
  std::fflush(stdout);

  Stages<HapticStage>& stages = measures.stages();
  const auto user = static_cast<std::uint32_t>(sub.user());
  Ending ending{.session = ports.session, .from_s = first.frame.stamp_s, .by = "last frame"};
  DeviceState device, from_device;
  device.device = user;
  TimePoint heard{};
  const Peer world_sim{ProgramKind::world_sim, 0}, device_sim{ProgramKind::device_sim, user};
  Presence world_there, device_there;
  bool foreign = false;  // the newest frame was of another run
  bool said_alone = false;
  std::array<WorldFrame, kMostWaiting> waiting;  // frames that came before their stamp
  for (WorldFrame& frame : waiting) reserve(frame, kUsualMembers);
  std::size_t waiting_count = 0;
  std::uint64_t newest_stamp = first.frame.stamp;
  TimePoint framed = first.received;  // when the newest frame came
  Arrears arrears;
  bool last = false;
  int fading = 0;
  const auto send_report = [&] {
    ports.send(sub.report(to_ns(Clock::now())));
    stages.mark(HapticStage::report);
  };

  // A world that trails the sub-world by a cycle has the cycle's report a haptic step before it needs it.
  const int lead_cycles = sub.scheme().properties.lead_cycles;
  // Users' loops are released one after the other, so that those that share a core do not wait for each other.
  const double stagger_s = h * static_cast<double>(sub.user()) / scene.settings.users;
  const auto ahead_s = [&](std::uint64_t stamp) {
    if (lead_cycles == 0) return stagger_s;
    const std::uint64_t until = stamp + static_cast<std::uint64_t>(lead_cycles);
    return h * static_cast<double>(sub.timetable().start(until) - sub.timetable().start(stamp)) + h + stagger_s;
  };
  Phase phase(longest_cycle_s, lead_cycles);
  Cyclic loop(first.received + from_seconds(first.frame.start_in_s - ahead_s(first.frame.stamp)), from_seconds(h),
              spin);
  Lateness lateness(thread_use());
  measures.loop_begins(scheduling);
  while (fading < kFadeSteps) {
    const TimePoint asked = Clock::now();
    const double lateness_s = to_seconds(loop.wait());
    const TimePoint begin = Clock::now();
    // What the machine has slept through is over: its forces would come too late to be felt.
    const int over_by_os = lateness.begin(loop.released(), asked, begin, from_seconds(h));
    const int over = loop.skip(begin);
    lateness.skipped_to(loop.released());
    measures.skipped(over, over_by_os);
    stages.begin(loop.released(), begin);
    arrears.owe(over * h * phase.rate());
    // What is there after a long sleep may be as old as that: the hand is let go, and met again from zero.
    if (lateness_s > kLongSleep_s) sub.re_engage();
    fading += last || stop_signal() != 0;

    while (take(ports.device, from_device, stages) == Take::sample) {
      if (from_device.session != ports.session || (heard != TimePoint{} && from_device.sender != device.sender))
        continue;
      ports.device.trust_sender();
      device = from_device;
      heard = begin;
    }
    const std::uint64_t refused = ports.frames.refused();
    while (waiting_count < waiting.size()) {
      if (take(ports.frames, waiting[waiting_count], stages) != Take::sample) break;
      foreign = waiting[waiting_count].session != ports.session;
      if (foreign) continue;
      // A world's stamps neither fall nor leap: what does is none to follow.
      const std::uint64_t stamp = waiting[waiting_count].stamp;
      if (stamp < newest_stamp || stamp > newest_stamp + kFarAhead) {
        measures.refused_frame();
        continue;
      }
      newest_stamp = stamp;
      if (ports.refused_by(waiting[waiting_count])) ending.fault = refused_text(user);
      // A world that stands sends the same stamp again and again: only the newest counts.
      if (waiting_count > 0 && waiting[waiting_count].stamp == waiting[waiting_count - 1].stamp) {
        std::swap(waiting[waiting_count], waiting[waiting_count - 1]);
        --waiting_count;
      }
      const WorldFrame& came = waiting[waiting_count++];
      framed = begin;
      const double until_s = to_seconds(begin - loop.released()) + came.start_in_s;
      phase.observe(came.stamp_s, ahead_s(came.stamp), until_s, came.real_time_factor, sub.time_s() + arrears.owed_s());
      last = last || came.last;
      if (came.echoed_sent_ns != 0) measures.round_trip(1e-9 * static_cast<double>(to_ns(begin) - came.echoed_sent_ns));
    }
    foreign = foreign || (framed != begin && ports.frames.refused() > refused);
    // Who has fallen too far behind goes on from the newest frame, and leaves undone what was missed.
    const bool behind = waiting_count > 0 && waiting[waiting_count - 1].stamp > sub.stamp() + kTooFarBehind;
    std::size_t used = behind ? waiting_count - 1 : 0;
    for (; used < waiting_count; ++used) {
      const WorldFrame& due = waiting[used];
      const bool lost_track = behind || !sub.finite() || !sub.agrees(due);
      if (!lost_track && !sub.accepts(due.stamp)) break;
      const TimePoint start = stages.now();
      std::uint64_t lost = 0;
      if (lost_track) {
        sub.reset_from(due);
        loop.shift(std::max(Duration::zero(), std::chrono::duration_cast<Duration>(start - loop.deadline())));
        arrears.forget();
        measures.resynchronised();
      } else {
        lost = sub.apply(due);
      }
      measures.synchronised(to_seconds(stages.mark(HapticStage::synchronise) - start), lost);
    }
    std::rotate(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(used), waiting.end());
    waiting_count -= used;

    orders.follow();
    stages.mark(HapticStage::control);

    world_there.observe(framed == begin, !foreign && alive(ports.frames, ports.status, world_sim), h);
    device_there.observe(heard == begin, alive(ports.device, ports.status, device_sim), h);
    if (ending.fault.empty() && world_there.gone()) {
      ending.fault = foreign ? replaced_text(ProgramKind::world_sim, 0) : gone_text(ProgramKind::world_sim, 0);
    } else if (ending.fault.empty() && device_there.gone()) {
      ending.fault = gone_text(ProgramKind::device_sim, user);
    }
    last = last || !ending.fault.empty();

    // Without the world it stands: what a border is frozen to does not hold for long.
    const double frame_period_s = longest_cycle_s / std::max(phase.real_time_factor(), kLeastRealTimeFactor);
    const bool alone = to_seconds(begin - framed) > std::max(kAlone_s, 4.0 * frame_period_s);
    sub.stand(alone || phase.real_time_factor() <= 0.0);
    const double rate = alone ? 0.0 : phase.step(sub.time_s());
    sub.set_rate(rate);
    const bool silent = begin - framed > from_seconds(kGone_s);
    if (silent && !said_alone) ports.status.note("waits for world_sim: no frame for 2 s; the force has faded");
    if (!silent && said_alone) ports.status.note("world_sim is there again");
    said_alone = silent;
    const bool trusted =
        fading == 0 && heard != TimePoint{} && to_seconds(begin - heard) < std::max(kStale_s, 5.0 * device_period_s);
    const FeltStep felt = heard == TimePoint{} ? FeltStep{} : sub.feel(device, trusted, h);
    stages.mark(HapticStage::feel);
    ports.command.write(sub.command_for(device, felt.to_operator));
    const TimePoint left = stages.mark(HapticStage::send);  // the force; missed: after its period
    const Miss miss = left > loop.deadline() ? lateness.judge(left, loop.deadline(), thread_use()) : Miss::none;
    if (sub.report_due()) send_report();
    sub.advance(arrears.step(h * rate, sub.cycle_left_s()));
    stages.mark(HapticStage::advance);
    if (sub.report_due()) send_report();

    loop.slew(phase.slew_ppm());
    const TimePoint end = stages.now();
    lateness.end(end, thread_use());
    sub.took(to_seconds(end - begin));
    measures.step(sub, felt, {to_seconds(end - begin), lateness_s, lateness.woken_late_s(), miss});
    ports.status.update(measures.state(sub.time_s()));
    stages.mark(HapticStage::account);
    measures.end_step();
  }
  measures.loop_ends();
  send_last(ports, device, kTimesLast);
  ending.to_s = sub.time_s();
  if (!ending.fault.empty()) {
    ending.by = "fault";
  } else if (!last) {
    ending.by = name_of_signal(stop_signal());
  }
  return ending;
}

}  // namespace subworld
