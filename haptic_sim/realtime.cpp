#include "coupling/deadband.hpp"
#include "haptic_sim/frame_queue.hpp"
#include "haptic_sim/head_start.hpp"
#include "haptic_sim/phase.hpp"
#include "haptic_sim/run.hpp"
#include "program/peer_watch.hpp"
#include "rt/arrears.hpp"
#include "rt/dilation.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "wire/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace subworld {

namespace {

constexpr double kStale_s = 0.005;          ///< age of a device's state on which no force relies
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
        longest_cycle_s_(scene.settings.longest_cycle_s()),
        lead_cycles_(scheme().lead_cycles),
        stagger_s_(h_s_ * user() / scene.settings.users),
        stale_s_(std::max(kStale_s, 5.0 / scene.users[user()].device.rate_hz) +
                 (scene.settings.deadband > 0.0 ? kLongestAbsence_s : 0.0)),
        absent_s_(std::max(kAbsent_s, 2.0 * stale_s_)),
        extrapolates_(scene.settings.deadband_in_use() > 0.0),
        deadband_(scene.settings.deadband_in_use(), scene.users[user()]),
        device_{.device = user(), .pose = {}, .applied = {}},
        peers_(scene.users.size()),
        known_peers_(scene.users.size()),
        peer_since_(scene.users.size()),
        device_sim_({ProgramKind::device_sim, user()}, options.wait_s),
        frames_(first.frame.stamp),
        world_sim_({ProgramKind::world_sim, 0}, options.wait_s, first.received),
        joins_(first.frame.served == 0),
        world_begins_(first.received + from_seconds(first.frame.start_in_s)),
        head_start_(first.round_trip_s, longest_cycle_s_),
        phase_(longest_cycle_s_, lead_cycles_, scene.settings.remote),
        loop_(std::max(Clock::now(), begin(first)), h_s_, from_seconds(options.spin_s), stages_),
        ending_{.session = ports.session, .from_s = first.frame.stamp_s, .by = kLastFrame} {
    // One that joins a running world begins behind it.
    arrears_.owe(std::max(0.0, to_seconds(Clock::now() - begin(first))));
  }

  Ending run(const Scheduling& scheduling) {
    fmt::print("haptic_sim {}: {:.0f} Hz, {}\n", user(), 1.0 / h_s_, scheduling.text);
    std::fflush(stdout);
    measures.loop_begins(scheduling);
    while (fading_ < kFadeSteps) step();
    measures.loop_ends();
    measures.sent(deadband_.sent_ratio());
    // After a fault the device learns from this program's end, and from its last words, that the run has failed.
    if (ending_.fault.empty()) send_last_command(ports, device_, kTimesLast);
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
    receive_device();
    receive_peers();
    receive_frames();
    use_frames();
    follow_orders();
    stages_.mark(HapticStage::control);
    watch_peers();
    Miss miss = Miss::none;
    const FeltStep felt = advance(miss);
    account(felt, miss);
  }

  /// When the sub-world is to begin, to be ahead of the world's clock as it should.
  [[nodiscard]] TimePoint begin(const FirstFrame& first) const {
    return first.received + from_seconds(first.frame.start_in_s - ahead_s(first.frame.stamp) - head_start_s());
  }

  void wake() {
    loop_.wait();
    const int over_by_os = loop_.wake(h_s_);
    // The periods that the OS has slept through are over: their forces would come too late to be felt.
    const int over = loop_.skip_missed();
    measures.skipped(over, over_by_os);
    loop_.begin();
    arrears_.owe(over * h_s_ * phase_.rate());
    fading_ += last_ || stop_signal() != 0;
  }

  /// The newest state of the device. Another device is heard only where this one has been absent.
  void receive_device() {
    device_returned_ = false;
    while (take(ports.device, came_, stages_) == Take::sample) {
      // After a restart of the world the device that is known finds the new session a little later.
      const bool known = device_heard() && came_.sender == device_.sender;
      if (!known && (came_.session != ports.session || (device_heard() && !device_absent_))) continue;
      ports.device.trust_sender();
      device_returned_ = device_returned_ || device_absent_;
      device_absent_ = false;
      device_ = sample_ = came_;
      device_sim_.heard(loop_.woke());
    }
    if (!device_heard()) return;
    const double passed_s = to_seconds(loop_.woke() - device_sim_.last_heard());
    if (passed_s > absent_s_ && !device_absent_) {
      device_absent_ = true;
      ports.device.distrust();
    }
    if (!extrapolates_ || passed_s <= 0.0) return;
    device_ = extrapolated(sample_, std::min(passed_s, kLongestAbsence_s));
    device_.sent_ns = 0;  // the round trip is of samples that came
  }
  /// The newest states of the devices whose users' proxies are in the sub-world. Where a device has been started again,
  /// the world's account of it counts for a while: only that knows where the new one is in the scene.
  void receive_peers() {
    for (std::size_t p = 0; p < peers_.size(); ++p) {
      known_peers_[p] = nullptr;
      if ((sub.facts().peers >> p & 1U) == 0) continue;
      Reader<DeviceState>* const reader = ports.peer_devices.find(p);
      if (reader == nullptr) continue;
      while (take(*reader, came_, stages_) == Take::sample) {
        if (came_.session != ports.session) continue;
        reader->trust_sender();
        if (peers_[p].sender != 0 && came_.sender != peers_[p].sender) peer_since_[p] = loop_.woke();
        peers_[p] = came_;
      }
      const bool placed = to_seconds(loop_.woke() - peer_since_[p]) > kAbsent_s;
      if (peers_[p].session == ports.session && placed) known_peers_[p] = &peers_[p];
    }
  }

  [[nodiscard]] bool device_heard() const noexcept { return device_sim_.last_heard() != TimePoint{}; }

  void receive_frames() {
    const TimePoint now = loop_.woke();
    while (!frames_.full() && take(ports.frames, frames_.slot(), stages_) == Take::sample) {
      if (frames_.slot().session != ports.session) continue;
      if (ports.serves_another(frames_.slot())) {
        world_sim_.serves_another(now);
        continue;
      }
      const WorldFrame* const came = frames_.push();
      if (came == nullptr) {
        measures.refused_frame();
        continue;
      }
      const bool served = came->served == ports.identity;
      if (came->last || served) measures.accepted();
      ports.frames.trust_sender();
      world_sim_.heard(now);
      if (served) {
        joins_ = false;
        head_start_.observe(came->stamp, came->newest_stamp, longest_cycle_s_);
        measures.framed(came->newest_stamp < came->stamp);
      } else {
        head_start_.wait();
      }
      const double until_s = to_seconds(now - loop_.released()) + came->start_in_s;
      phase_.observe(came->stamp_s, ahead_s(came->stamp), head_start_s(), until_s, came->real_time_factor,
                     sub.facts().time_s + arrears_.owed_s(), to_seconds(now - world_begins_));
      last_ = last_ || came->last;
      measures.answered(came->echoed_sent_ns, now);
    }
  }

  void use_frames() {
    const std::span<const WorldFrame> waiting = frames_.waiting();
    if (waiting.empty()) return;
    // A sub-world starts anew from the newest frame where it has fallen too far behind, or where the world has missed
    // it for so long that the user counts as absent.
    const bool anew = (!framed_ || (waiting.back().served == 0 && !joins_)) && !last_;
    const bool behind = anew || waiting.back().stamp > sub.facts().stamp + kTooFarBehind;
    std::size_t used = behind ? waiting.size() - 1 : 0;
    for (; used < waiting.size(); ++used) {
      const WorldFrame& due = waiting[used];
      const bool lost_track = behind || !sub.facts().finite || !sub.agrees(due);
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
    const bool stands = used > 0 && waiting[used - 1].real_time_factor <= 0.0;
    joins_ = joins_ || anew;
    framed_ = true;
    frames_.drop(used);
    // A world that waits for its users is answered, each time, for the answer may be lost.
    if (joins_ && stands) ports.send(*sub.close_cycle(to_ns(Clock::now())));
  }

  void reset_from(const WorldFrame& frame, TimePoint now) {
    sub.reset_from(frame);
    loop_.shift(std::max(0.0, to_seconds(now - loop_.deadline())));
    arrears_.forget();
    phase_.restart();
    measures.resynchronised();
  }

  void watch_peers() {
    const TimePoint now = loop_.woke();
    world_sim_.observe(ports.frames, ports.status, now, h_s_);
    device_sim_.observe(ports.device, ports.status, now, h_s_);
    for (const PeerWatch* peer : {&world_sim_, &device_sim_}) {
      if (ending_.fault.empty()) ending_.fault = peer->fault(ports.status);
    }
    last_ = last_ || !ending_.fault.empty();
    look_for_world();
    const bool silent = now - world_sim_.last_heard() > from_seconds(kGone_s);
    if (silent && !silent_)
      ports.status.note("waits for world_sim: no frame for 2 s; the force has faded", "world_sim");
    if (!silent && silent_) ports.status.note("world_sim is there again", "");
    silent_ = silent;
  }

  /// Without a frame for so long, the world is away. One that runs slowly sends them rarely.
  [[nodiscard]] double patience_s() const noexcept {
    return std::max(kAbsent_s, 4.0 * longest_cycle_s_ / std::max(phase_.real_time_factor(), kLeastRealTimeFactor));
  }

  /// A world that has been started again has another session.
  void look_for_world() {
    if (world_sim_.quiet_s() < patience_s()) {
      world_absent_ = false;
      return;
    }
    if (!std::exchange(world_absent_, true)) {
      ports.frames.distrust();
      joins_ = false;
    }
    if (last_ || !finder.look(options.network.domain) || finder.session() == ports.session) return;
    ports.session = ending_.session = finder.session();
    joins_ = false;
    framed_ = false;
    frames_.restart();
    phase_ = Phase(longest_cycle_s_, lead_cycles_, scene.settings.remote);
  }

  FeltStep advance(Miss& miss) {
    const TimePoint now = loop_.woke();
    // Without frames the sub-world pauses: its border holds for a short time only.
    const TimePoint heard = std::max(world_sim_.last_heard(), world_begins_);
    const bool alone = to_seconds(now - heard) > patience_s();
    const double rate = alone ? 0.0 : phase_.step(sub.facts().time_s, h_s_);
    const auto send = [&](const FeltStep& felt) {
      stages_.mark(HapticStage::feel);
      DeviceCommand command = sub.command_for(device_, felt.to_operator);
      command.session = ports.session;
      if (deadband_.sends(command, felt.to_operator, h_s_)) ports.command.write(command);
      miss = loop_.judge(stages_.mark(HapticStage::send), loop_.deadline());
    };
    const auto report = [&] {
      stages_.mark(HapticStage::advance);
      HapticReport* const closed = sub.close_cycle(to_ns(Clock::now()));
      if (framed_) ports.send(*closed);
      stages_.mark(HapticStage::report);
    };
    const double dt = arrears_.step(h_s_ * rate, sub.facts().cycle_left_s);
    // A force after a long sleep would rely on old states.
    const StepInput input{
        .device = device_heard() ? &device_ : nullptr,
        .device_trusted = fading_ == 0 && device_heard() && to_seconds(now - device_sim_.last_heard()) < stale_s_,
        .peers = known_peers_,
        .wall_s = h_s_,
        .dt = dt,
        .clock_rate = rate,
        .took_s = took_s_,
        .paused = alone || device_absent_ || phase_.stands(),
        .slept = loop_.lateness_s() > kLongSleep_s,
        .device_returned = device_returned_};
    const FeltStep felt = sub.step(input, send, report);
    stages_.mark(HapticStage::advance);
    return felt;
  }

  void account(const FeltStep& felt, Miss miss) {
    loop_.slew(phase_.slew_ppm());
    const TimePoint end = stages_.now();
    loop_.end(end);
    took_s_ = to_seconds(end - loop_.woke());
    measures.step(sub, felt, {took_s_, loop_.lateness_s(), loop_.woken_late_s(), miss});
    ports.status.update(measures.state(sub.facts().time_s));
    stages_.mark(HapticStage::account);
    measures.end_step();
  }

  /// By how much the haptic clock is ahead of the world's when that shows a frame's stamp. A world that trails the
  /// sub-world by a cycle has the cycle's report a haptic step before it needs it. Users' loops are released one after
  /// the other, so that those that share a core do not wait for each other.
  [[nodiscard]] double ahead_s(std::uint64_t stamp) const {
    if (lead_cycles_ == 0) return stagger_s_;
    const Timetable& timetable = sub.timetable();
    const std::uint64_t until = stamp + static_cast<std::uint64_t>(lead_cycles_);
    return h_s_ * static_cast<double>(timetable.start(until) - timetable.start(stamp)) + h_s_ + stagger_s_;
  }
  /// Between hosts, the round trip on top of that, where the world trails the sub-world.
  [[nodiscard]] double head_start_s() const {
    return scene.settings.remote && lead_cycles_ > 0 ? head_start_.head_start_s() : 0.0;
  }

  Stages<HapticStage>& stages_;
  double h_s_;
  double longest_cycle_s_;
  int lead_cycles_;
  double stagger_s_;
  double stale_s_;   ///< age of the device's state at which the force fades out
  double absent_s_;  ///< age from which the device is absent
  bool extrapolates_;
  Deadband<DeviceCommand> deadband_;
  DeviceState device_, came_;
  DeviceState sample_;                           ///< the newest that came, while `device_` is extrapolated from it
  std::vector<DeviceState> peers_;               ///< by user
  std::vector<const DeviceState*> known_peers_;  ///< by user; null: none has come
  std::vector<TimePoint> peer_since_;            ///< by user: when another device took the place of the first
  PeerWatch device_sim_;
  bool device_absent_ = false, device_returned_ = false;
  FrameQueue frames_;
  PeerWatch world_sim_;
  bool joins_;          ///< the sub-world has started anew, and no frame says yet that the world serves it
  bool framed_ = true;  ///< the world's run has sent a frame, from which the sub-world has started
  bool world_absent_ = false;
  TimePoint world_begins_;  ///< before, it sends no frames
  HeadStart head_start_;
  Phase phase_;
  Arrears arrears_;
  PacedLoop<HapticStage> loop_;
  Ending ending_;
  double took_s_ = 0.0;  ///< the step before
  bool silent_ = false;  ///< frames stay away, and the user knows
  bool last_ = false;
  int fading_ = 0;  ///< steps since the run is to end
};

}  // namespace

Ending run_realtime(const HapticRun& run, const FirstFrame& first) {
  const Scheduling scheduling = claim_realtime(priority::kHaptic);
  return RealtimeLoop(run, first).run(scheduling);
}

}  // namespace subworld
