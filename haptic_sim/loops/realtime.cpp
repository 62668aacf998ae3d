#include "coupling/messages/deadband.hpp"
#include "haptic_sim/loops/device_link.hpp"
#include "haptic_sim/loops/frame_link.hpp"
#include "haptic_sim/loops/run.hpp"
#include "haptic_sim/loops/world_clock.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>

namespace subworld {

namespace {

constexpr double kLongSleep_s = 0.05;       ///< longer than a device needs to fade out without commands
constexpr int kFadeSteps = 30;              ///< before the last command: the force fades to zero
constexpr int kTimesLast = 5;               ///< the last command is sent: one may get lost
constexpr std::uint64_t kTooFarBehind = 8;  ///< cycles; then the sub-world restarts from the world's states

/// The haptic process in real time.
class RealtimeLoop : HapticRun {
 public:
  RealtimeLoop(const HapticRun& run, const FirstFrame& first)
      : HapticRun(run),
        stages_(measures.stages()),
        h_s_(scene.settings.h_s),
        deadband_(scene.settings.deadband_in_use(), scene.users[user()]),
        device_(*this),
        peers_(scene.users.size()),
        frames_(*this, first),
        clock_(*this, first),
        loop_(std::max(Clock::now(), clock_.begins()), h_s_, from_seconds(options.spin_s), stages_),
        ending_{.session = ports.session, .from_s = first.frame.stamp_s, .by = kLastFrame} {}

  Ending run(const Scheduling& scheduling) {
    fmt::print("haptic_sim {}: {:.0f} Hz, {}\n", user(), 1.0 / h_s_, scheduling.text);
    std::fflush(stdout);
    measures.loop_begins(scheduling);
    while (fading_ < kFadeSteps) step();
    measures.loop_ends();
    measures.sent(deadband_.sent_ratio());
    // After a fault the device learns from this program's end, and from its last words, that the run has failed.
    if (ending_.fault.empty()) send_last_command(ports, device_.state(), kTimesLast);
    if (const std::string text = ports.peer_devices.fault(); !text.empty()) ports.status.note(text);
    ending_.to_s = sub.facts().time_s;
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
    device_.receive(loop_.woke(), stages_);
    known_peers_ = peers_.receive(ports.peer_devices, ports.session, sub.facts().peers, loop_.woke(), stages_);
    receive_frames();
    use_frames();
    follow_orders();
    stages_.mark(HapticStage::control);
    watch_peers();
    Miss miss = Miss::none;
    const FeltStep felt = advance(miss);
    account(felt, miss);
  }

  void wake() {
    loop_.wait();
    const int over_by_os = loop_.wake(h_s_);
    // The periods that the OS has slept through are over: their forces would come too late to be felt.
    const int over = loop_.skip_missed();
    if (!clock_.phase().stands()) measures.skipped(over, over_by_os);
    loop_.begin();
    clock_.skip(over * h_s_);
    fading_ += last_ || stop_signal() != 0;
  }

  void receive_frames() {
    const TimePoint now = loop_.woke();
    while (const WorldFrame* const came = frames_.receive(now, stages_)) {
      const bool served = came->served == ports.identity;
      if (came->last || served) measures.accepted();
      if (served) measures.framed(came->newest_stamp < came->stamp);
      clock_.observe(*came, served, now, loop_.released());
      last_ = last_ || came->last;
      measures.answered(came->echoed_sent_ns, now);
    }
  }

  void use_frames() {
    const std::span<const WorldFrame> waiting = frames_.waiting();
    if (waiting.empty()) return;
    const bool anew = frames_.begins_anew() && !last_;
    const bool behind = anew || waiting.back().stamp > sub.facts().stamp + kTooFarBehind;
    std::size_t used = behind ? waiting.size() - 1 : 0;
    for (; used < waiting.size(); ++used) {
      const WorldFrame& due = waiting[used];
      const bool lost_track = behind || !sub.facts().finite || !sub.clock().agrees(due);
      if (!lost_track && !sub.accepts(due.stamp)) break;
      const TimePoint start = stages_.now();
      std::uint64_t lost = 0;
      if (lost_track) {
        reset_from(due, start);
      } else {
        lost = sub.synchronise_with(due);
      }
      measures.synchronised(to_seconds(stages_.mark(HapticStage::synchronise) - start), lost);
    }
    if (frames_.used(used, anew)) ports.send(*sub.close_cycle(to_ns(Clock::now())));
  }

  void reset_from(const WorldFrame& frame, TimePoint now) {
    sub.reset_from(frame);
    loop_.shift(std::max(0.0, to_seconds(now - loop_.deadline())));
    clock_.restart();
    measures.resynchronised();
  }

  void watch_peers() {
    const TimePoint now = loop_.woke();
    frames_.watch().observe(ports.frames, ports.status, now, h_s_);
    device_.watch().observe(ports.device, ports.status, now, h_s_);
    for (const PeerWatch* peer : {&frames_.watch(), &device_.watch()}) {
      if (ending_.fault.empty()) ending_.fault = peer->fault(ports.status);
    }
    last_ = last_ || !ending_.fault.empty();
    if (!frames_.observe(now, clock_.patience_s(), last_)) return;
    ending_.session = ports.session;
    clock_.follow_anew();
  }

  FeltStep advance(Miss& miss) {
    const TimePoint now = loop_.woke();
    // Without frames the sub-world pauses: its border holds for a short time only.
    const TimePoint heard = std::max(frames_.watch().last_heard(), clock_.world_begins());
    const bool alone = to_seconds(now - heard) > clock_.patience_s();
    const double rate = alone ? 0.0 : clock_.step();
    const auto send = [&](const FeltStep& felt) {
      stages_.mark(HapticStage::feel);
      DeviceCommand command = sub.command_for(device_.state(), felt.to_operator);
      command.session = ports.session;
      if (deadband_.sends(command, felt.to_operator, h_s_)) ports.command.write(command);
      miss = loop_.judge(stages_.mark(HapticStage::send), loop_.deadline());
    };
    const auto report = [&] {
      stages_.mark(HapticStage::advance);
      HapticReport* const closed = sub.close_cycle(to_ns(Clock::now()));
      if (frames_.framed() && !clock_.phase().cut_off()) ports.send(*closed);
      stages_.mark(HapticStage::report);
    };
    // A force after a long sleep would rely on old states.
    const StepInput input{.device = device_.heard() ? &device_.state() : nullptr,
                          .device_trusted = fading_ == 0 && device_.fresh(now),
                          .peers = known_peers_,
                          .wall_s = h_s_,
                          .dt = clock_.step_s(rate),
                          .clock_rate = rate,
                          .took_s = took_s_,
                          .paused = alone || device_.absent() || clock_.phase().stands(),
                          .slept = loop_.lateness_s() > kLongSleep_s,
                          .device_returned = device_.returned()};
    const FeltStep felt = sub.step(input, send, report);
    stages_.mark(HapticStage::advance);
    return felt;
  }

  void account(const FeltStep& felt, Miss miss) {
    loop_.slew(clock_.phase().slew_ppm());
    const TimePoint end = stages_.now();
    loop_.end(end);
    took_s_ = to_seconds(end - loop_.woke());
    if (clock_.phase().stands()) miss = Miss::none;  // while the run is paused, no force depends on the step
    measures.step(sub, felt, {took_s_, loop_.lateness_s(), loop_.woken_late_s(), miss});
    ports.status.update(measures.state(sub.facts().time_s));
    stages_.mark(HapticStage::account);
    measures.end_step();
  }

  Stages<HapticStage>& stages_;
  double h_s_;
  Deadband<DeviceCommand> deadband_;
  DeviceLink device_;
  PeerStates peers_;
  std::span<const DeviceState* const> known_peers_;
  FrameLink frames_;
  WorldClock clock_;
  PacedLoop<HapticStage> loop_;
  Ending ending_;
  double took_s_ = 0.0;  ///< the step before
  bool last_ = false;
  int fading_ = 0;  ///< steps since the run is to end
};

}  // namespace

Ending run_realtime(const HapticRun& run, const FirstFrame& first) {
  const Scheduling scheduling = claim_realtime(priority::kHaptic);
  return RealtimeLoop(run, first).run(scheduling);
}

}  // namespace subworld
