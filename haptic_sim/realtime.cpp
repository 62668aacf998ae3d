#include "haptic_sim/device_feed.hpp"
#include "haptic_sim/engine_orders.hpp"
#include "haptic_sim/frame_queue.hpp"
#include "haptic_sim/peer_watch.hpp"
#include "haptic_sim/phase.hpp"
#include "haptic_sim/run.hpp"
#include "rt/arrears.hpp"
#include "rt/dilation.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace subworld {

namespace {

constexpr double kLongSleep_s = 0.05;       ///< longer than a device needs to fade out without commands
constexpr double kAlone_s = 0.25;           ///< without a frame: the world has gone or is paused
constexpr int kFadeSteps = 30;              ///< before the last command: the force fades to zero
constexpr int kTimesLast = 5;               ///< the last command is sent: one may get lost
constexpr std::uint64_t kTooFarBehind = 8;  ///< cycles; then the sub-world restarts from the world's states

/// The haptic process in real time.
class RealtimeLoop {
 public:
  RealtimeLoop(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
               const Scene& scene, const FirstFrame& first, Duration spin)
      : ports_(ports),
        sub_(sub),
        measures_(measures),
        stages_(measures.stages()),
        orders_(ports, sub, measures, exchange),
        h_s_(scene.settings.h_s),
        longest_cycle_s_(scene.settings.longest_cycle_s()),
        lead_cycles_(sub.scheme().properties.lead_cycles),
        stagger_s_(h_s_ * static_cast<double>(sub.user()) / scene.settings.users),
        device_(static_cast<std::uint32_t>(sub.user()), scene.users[sub.user()].device.rate_hz),
        frames_(first.frame.stamp),
        peers_(static_cast<std::uint32_t>(sub.user()), first.received),
        phase_(longest_cycle_s_, lead_cycles_),
        loop_(first.received + from_seconds(first.frame.start_in_s - ahead_s(first.frame.stamp)), h_s_, spin, stages_),
        ending_{.session = ports.session, .from_s = first.frame.stamp_s, .by = "last frame"} {}

  Ending run(const Scheduling& scheduling) {
    measures_.loop_begins(scheduling);
    while (fading_ < kFadeSteps) step();
    measures_.loop_ends();
    send_last_command(ports_, device_.state(), kTimesLast);
    ending_.to_s = sub_.time_s();
    if (!ending_.fault.empty()) {
      ending_.by = "fault";
    } else if (!last_) {
      ending_.by = name_of_signal(stop_signal());
    }
    return ending_;
  }

 private:
  void step() {
    wake();
    device_.receive(ports_, stages_, loop_.woke());
    receive_frames();
    use_frames();
    orders_.follow();
    stages_.mark(HapticStage::control);
    watch_peers();
    const double rate = follow_clock();
    Miss miss = Miss::none;
    const FeltStep felt = advance(rate, miss);
    account(felt, miss);
  }

  void wake() {
    loop_.wait();
    const int over_by_os = loop_.wake(h_s_);
    // The periods that the OS has slept through are over: their forces would come too late to be felt.
    const int over = loop_.skip_missed();
    measures_.skipped(over, over_by_os);
    loop_.begin();
    arrears_.owe(over * h_s_ * phase_.rate());
    // A force after a long sleep would rely on old states.
    if (loop_.lateness_s() > kLongSleep_s) sub_.re_engage();
    fading_ += last_ || stop_signal() != 0;
  }

  void receive_frames() {
    const TimePoint now = loop_.woke();
    const std::uint64_t refused = ports_.frames.refused();
    while (!frames_.full() && take(ports_.frames, frames_.slot(), stages_) == Take::sample) {
      const bool foreign = frames_.slot().session != ports_.session;
      peers_.frame_came(foreign);
      if (foreign) continue;
      const WorldFrame* const came = frames_.push();
      if (came == nullptr) {
        measures_.refused_frame();
        continue;
      }
      if (ports_.refused_by(*came)) ending_.fault = refused_text(static_cast<std::uint32_t>(sub_.user()));
      peers_.framed(now);
      const double until_s = to_seconds(now - loop_.released()) + came->start_in_s;
      phase_.observe(came->stamp_s, ahead_s(came->stamp), until_s, came->real_time_factor,
                     sub_.time_s() + arrears_.owed_s());
      last_ = last_ || came->last;
      measures_.answered(came->echoed_sent_ns, now);
    }
    if (ports_.frames.refused() > refused) peers_.refused(now);
  }

  void use_frames() {
    const std::span<const WorldFrame> waiting = frames_.waiting();
    // A sub-world that has fallen too far behind restarts from the newest frame.
    const bool behind = !waiting.empty() && waiting.back().stamp > sub_.stamp() + kTooFarBehind;
    std::size_t used = behind ? waiting.size() - 1 : 0;
    for (; used < waiting.size(); ++used) {
      const WorldFrame& due = waiting[used];
      const bool lost_track = behind || !sub_.finite() || !sub_.agrees(due);
      if (!lost_track && !sub_.accepts(due.stamp)) break;
      const TimePoint start = stages_.now();
      std::uint64_t lost = 0;
      if (lost_track) {
        reset_from(due, start);
      } else {
        lost = sub_.synchronise_with(due);
      }
      measures_.synchronised(to_seconds(stages_.mark(HapticStage::synchronise) - start), lost);
    }
    frames_.drop(used);
  }

  void reset_from(const WorldFrame& frame, TimePoint now) {
    sub_.reset_from(frame);
    loop_.shift(std::max(0.0, to_seconds(now - loop_.deadline())));
    arrears_.forget();
    measures_.resynchronised();
  }

  void watch_peers() {
    const TimePoint now = loop_.woke();
    const std::string fault = peers_.observe(ports_, device_.heard_at(now), now, h_s_);
    if (ending_.fault.empty()) ending_.fault = fault;
    last_ = last_ || !ending_.fault.empty();
  }

  /// Simulated seconds per second in the step that begins. Without frames the sub-world pauses: its border holds for a
  /// short time only.
  double follow_clock() {
    const TimePoint now = loop_.woke();
    const double frame_period_s = longest_cycle_s_ / std::max(phase_.real_time_factor(), kLeastRealTimeFactor);
    const bool alone = peers_.without_frame_s(now) > std::max(kAlone_s, 4.0 * frame_period_s);
    sub_.pause(alone || phase_.real_time_factor() <= 0.0);
    const double rate = alone ? 0.0 : phase_.step(sub_.time_s());
    sub_.set_rate(rate);
    peers_.announce(ports_.status, now);
    return rate;
  }

  FeltStep advance(double rate, Miss& miss) {
    const TimePoint now = loop_.woke();
    const auto send = [&](const FeltStep& felt) {
      stages_.mark(HapticStage::feel);
      ports_.command.write(sub_.command_for(device_.state(), felt.to_operator));
      miss = loop_.judge(stages_.mark(HapticStage::send), loop_.deadline());
    };
    const auto report = [&] {
      stages_.mark(HapticStage::advance);
      ports_.send(sub_.report(to_ns(Clock::now())));
      stages_.mark(HapticStage::report);
    };
    const double dt = arrears_.step(h_s_ * rate, sub_.cycle_left_s());
    const DeviceState* const device = device_.heard() ? &device_.state() : nullptr;
    const FeltStep felt = sub_.step({device, fading_ == 0 && device_.fresh(now), h_s_, dt}, send, report);
    stages_.mark(HapticStage::advance);
    return felt;
  }

  void account(const FeltStep& felt, Miss miss) {
    loop_.slew(phase_.slew_ppm());
    const TimePoint end = stages_.now();
    loop_.end(end);
    const double step_s = to_seconds(end - loop_.woke());
    sub_.took(step_s);
    measures_.step(sub_, felt, {step_s, loop_.lateness_s(), loop_.woken_late_s(), miss});
    ports_.status.update(measures_.state(sub_.time_s()));
    stages_.mark(HapticStage::account);
    measures_.end_step();
  }

  /// By how much the haptic clock is ahead of the world's when that shows a frame's stamp. A world that trails the
  /// sub-world by a cycle has the cycle's report a haptic step before it needs it. Users' loops are released one after
  /// the other, so that those that share a core do not wait for each other.
  [[nodiscard]] double ahead_s(std::uint64_t stamp) const {
    if (lead_cycles_ == 0) return stagger_s_;
    const Timetable& timetable = sub_.timetable();
    const std::uint64_t until = stamp + static_cast<std::uint64_t>(lead_cycles_);
    return h_s_ * static_cast<double>(timetable.start(until) - timetable.start(stamp)) + h_s_ + stagger_s_;
  }

  HapticPorts& ports_;
  SubWorld& sub_;
  HapticMeasures& measures_;
  Stages<HapticStage>& stages_;
  EngineOrders orders_;
  double h_s_;
  double longest_cycle_s_;
  int lead_cycles_;
  double stagger_s_;
  DeviceFeed device_;
  FrameQueue frames_;
  PeerWatch peers_;
  Phase phase_;
  Arrears arrears_;
  PacedLoop<HapticStage> loop_;
  Ending ending_;
  bool last_ = false;
  int fading_ = 0;  ///< steps since the run is to end
};

}  // namespace

Ending run_realtime(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                    const Scene& scene, const FirstFrame& first, Duration spin) {
  const Scheduling scheduling = claim_realtime(priority::kHaptic);
  fmt::print("haptic_sim {}: {:.0f} Hz, {}\n", sub.user(), 1.0 / scene.settings.h_s, scheduling.text);
  std::fflush(stdout);
  return RealtimeLoop(ports, sub, measures, exchange, scene, first, spin).run(scheduling);
}

}  // namespace subworld
