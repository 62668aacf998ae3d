#include "device_sim/run.hpp"

#include "coupling/messages/deadband.hpp"
#include "device_sim/command_check.hpp"
#include "model/error.hpp"
#include "program/join.hpp"
#include "program/peer_watch.hpp"
#include "rt/paced_loop.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kSuspended_s = 0.005;  ///< late by so long, the device has not moved meanwhile
constexpr double kLate_s = 0.002;       ///< shortest age of a command at which the force fades out

}  // namespace

DevicePorts::DevicePorts(const Options& options, const Scene& scene_file)
    : bus(open_bus(
          options.network, scene_file.settings,
          scene_file.settings.sample_period_s(scene_file.users[static_cast<std::size_t>(options.user)].device.rate_hz),
          fmt::format("device_sim {}", options.user))),
      scene(bus->reader<SceneDescription>()),
      states(bus->writer<DeviceState>(device_partition(options.user))),
      commands(bus->reader<DeviceCommand>(device_partition(options.user))),
      status(*bus, ProgramKind::device_sim, static_cast<std::uint32_t>(options.user),
             fmt::format("device_sim {}", options.user)) {
  const Settings& settings = scene_file.settings;
  if (settings.mode == Mode::lockstep || settings.users < 2) return;
  const double rate_hz = scene_file.users[static_cast<std::size_t>(options.user)].device.rate_hz;
  shared_states.emplace(bus->shared_device_writer(device_partition(options.user), shared_period_s(settings, rate_hz)));
}

bool DeviceRun::send_state(TimePoint now, DeviceState state, bool to_all) const noexcept {
  state.session = session;
  state.sender = ports.identity;
  state.sent_ns = to_ns(now);
  if (!ports.states.write(state)) return false;
  if (to_all && ports.shared_states) ports.shared_states->write(state);
  return true;
}

std::optional<std::uint64_t> join(const DeviceRun& run) {
  const Options& options = run.options;
  DevicePorts& ports = run.ports;
  ports.status.enter("waiting");
  SessionFinder& finder = run.finder;
  const auto found = [&] { return finder.look(options.network.domain); };
  // A world may take long to load; its status arrives every second.
  const auto world_is_there = [&] { return ports.status.hears(ProgramKind::world_sim, 0); };
  if (!wait_for(*ports.bus, options, {"world", "world_sim"}, found, world_is_there)) return std::nullopt;
  const Wanted haptic{fmt::format("haptic_sim for user {}", options.user),
                      fmt::format("haptic_sim --user {}", options.user)};
  // Without its status, a program that takes long to find the others would later count as dead.
  const auto held = [&] {
    return found() && ports.states.matched() > 0 && ports.commands.matched() > 0 &&
           ports.status.met(ProgramKind::haptic_sim, static_cast<std::uint32_t>(options.user));
  };
  if (!wait_for(*ports.bus, options, haptic, held)) return std::nullopt;
  ports.status.enter("running");
  return finder.session();
}

namespace {

/// The first answer in lock-step comes when the world has let the user take part, perhaps of a haptic process that is
/// yet to come. False when asked to stop. Throws `Error` (failed) where none comes, and where another device is served.
template <class Ours>
bool await_first(const DeviceRun& run, DeviceCommand& command, Ours ours) {
  const std::uint32_t user = run.device.state().device;
  const std::string haptic = fmt::format("haptic_sim {}", user);
  TimePoint displaced{};
  const auto answered = [&] {
    while (run.ports.commands.take(command) == Take::sample) {
      if (ours(command)) return true;
      if (command.session != run.session || command.served == run.ports.identity || command.served == 0) continue;
      // Of a device that was killed, there may still be commands.
      if (displaced == TimePoint{}) displaced = Clock::now();
      if (to_seconds(Clock::now() - displaced) > kGone_s)
        throw Error(ExitCode::failed, displaced_text(ProgramKind::haptic_sim, user));
    }
    return false;
  };
  const auto comes = [&] { return run.ports.status.hears(ProgramKind::haptic_sim, user); };
  try {
    return wait_for(*run.ports.bus, run.options, {"answer of " + haptic, fmt::format("haptic_sim --user {}", user)},
                    answered, comes);
  } catch (const Error&) {
    if (displaced == TimePoint{}) throw;
    throw Error(ExitCode::failed, displaced_text(ProgramKind::haptic_sim, user));
  }
}

}  // namespace

Ending run_lockstep(const DeviceRun& run) {
  const auto& [options, scene, ports, device, guard, measures, finder, session] = run;
  const double h_s = scene.settings.h_s;
  Ending ending{.session = session, .from_s = device.state().stamp_s, .by = kLastCommand};
  DeviceCommand command;
  Deadband<DeviceState> deadband(scene.settings.deadband_in_use(), scene.users[static_cast<std::size_t>(options.user)]);
  Wrench felt;
  bool waits_for_first = true;
  const auto stopped = [] { return stop_signal() != 0; };
  Stages<DeviceStage>& stages = measures.stages();
  stages.begin();
  while (true) {
    const TimePoint sent = Clock::now();
    const DeviceState state = device.state();
    if (!run.send_state(sent, deadband.pass(state, felt, h_s)))
      throw Error(ExitCode::failed, unsent_text("device_state", ports.commands, ports.status, run.haptic_sim()));
    stages.mark(DeviceStage::send);
    const auto ours = [&](const DeviceCommand& came) {
      return came.session == session && came.served == ports.identity && (came.last || came.sequence == state.sequence);
    };
    ending.to_s = state.stamp_s;
    const bool first = std::exchange(waits_for_first, false);
    if (first ? !await_first(run, command, ours)
              : !await(*ports.bus, ports.status, ports.commands, command, stages, run.haptic_sim(), ours, stopped)) {
      ending.by = name_of_signal(stop_signal());
      return ending;
    }
    ports.commands.trust_sender();
    if (first)
      ports.status.begins(run.haptic_sim().program, run.haptic_sim().instance, ports.commands.sender_participant());
    measures.sent(deadband.sent_ratio());
    if (command.last) return ending;
    if (command.stamp_s > state.stamp_s + h_s && state.sequence == 0) {
      device.resume_at(command.stamp_s);
      measures.joins_late();
      ending.from_s = device.state().stamp_s;
      continue;
    }
    measures.answered(command.echoed_sent_ns, stages.now());
    const DeviceCommand safe = guard.pass(command, state, true, h_s);
    felt = safe.wrench;
    device.step(safe, h_s);
    stages.mark(DeviceStage::advance);
    measures.step(state, safe.wrench, {to_seconds(stages.now() - sent)});
    ports.status.update(measures.state(state.stamp_s));
    stages.mark(DeviceStage::account);
    measures.end_step();
  }
}

namespace {

/// The device process in real time: at the device's own rate, with the newest command.
class RealtimeLoop : DeviceRun {
 public:
  explicit RealtimeLoop(const DeviceRun& run)
      : DeviceRun(run),
        stages_(measures.stages()),
        rate_hz_(scene.users[static_cast<std::size_t>(options.user)].device.rate_hz),
        period_s_(1.0 / rate_hz_),
        stale_s_(std::max(kLate_s, 2.0 * std::max(period_s_, scene.settings.h_s)) +
                 scene.settings.sample_period_s(rate_hz_) - period_s_),
        shared_every_(scene.settings.deadband_in_use() > 0.0
                          ? 1
                          : std::max(1, static_cast<int>(std::lround(kShared_s * rate_hz_)))),
        deadband_(scene.settings.deadband_in_use(), scene.users[static_cast<std::size_t>(options.user)]),
        loop_(Clock::now(), period_s_, from_seconds(options.spin_s), stages_),
        absent_s_(std::max(kAbsent_s, 2.0 * stale_s_)),
        haptic_(haptic_sim(), options.wait_s) {}

  Ending run(const Scheduling& scheduling) {
    fmt::print("device_sim {}: {:.0f} Hz, {}\n", options.user, rate_hz_, scheduling.text);
    std::fflush(stdout);
    Ending ending{.session = session, .from_s = device.state().stamp_s, .by = kLastCommand};
    measures.loop_begins(scheduling);
    while (stop_signal() == 0 && ending.fault.empty()) {
      wake();
      receive();
      if (command_.last) break;
      haptic_.observe(ports.commands, ports.status, loop_.woke(), period_s_);
      look_for_run();
      ending.fault = haptic_.fault(ports.status);
      if (ending.fault.empty()) act(fresh());
    }
    // The commands with which the haptic loop fades the force may have arrived late or not at all.
    while (!felt_.force.isZero() || !felt_.torque.isZero()) {
      wake();
      act(false);
    }
    measures.loop_ends();
    measures.sent(deadband_.sent_ratio());
    ending.session = session;
    ending.to_s = device.state().stamp_s;
    if (!ending.fault.empty()) {
      ending.by = "fault";
    } else if (!command_.last) {
      ending.by = name_of_signal(stop_signal());
    }
    return ending;
  }

 private:
  void wake() {
    loop_.wait();
    loop_.wake(period_s_);
    // A device that was suspended did not move meanwhile: it does not catch up.
    if (to_seconds(loop_.woke() - loop_.deadline()) > kSuspended_s) (void)loop_.skip_missed();
    loop_.begin();
  }

  void receive() {
    const TimePoint now = loop_.woke();
    while (take(ports.commands, came_, stages_) == Take::sample) {
      const bool to_us = came_.served == ports.identity || (came_.last && came_.served == 0);
      if (came_.session != session && came_.served == ports.identity) follow_world();
      if (came_.session != session) continue;
      if (!to_us) {
        if (came_.served != 0) haptic_.serves_another(now);
        continue;
      }
      if (!check_.possible(came_)) {
        drop_forged();
        continue;
      }
      if (came_.served == ports.identity) ports.commands.trust_sender();
      if (!running() && came_.stamp_s > kAbsent_s) resume(came_.stamp_s);
      stands_ = came_.stamp_s == command_.stamp_s;
      command_ = came_;
      measures.answered(command_.echoed_sent_ns, now);
      haptic_.heard(now);
    }
  }

  void drop_forged() {
    guard.soften();
    if (measures.forged_command() > 1) return;
    ports.status.note(
        fmt::format("device_sim {}: dropped a device_command that haptic_sim {} did not send: another program on this "
                    "network forges its packets; from now on only counted",
                    options.user, options.user));
  }

  /// This program takes the place of one that has died.
  void resume(double at_s) {
    device.resume_at(at_s);
    measures.joins_late();
  }

  /// A haptic process, or a world, that has been started again is another one than that which was trusted.
  void look_for_run() {
    if (haptic_.quiet_s() < absent_s_) {
      absent_ = false;
      return;
    }
    if (!std::exchange(absent_, true)) ports.commands.distrust();
    follow_world();
  }
  void follow_world() {
    if (finder.look(options.network.domain)) session = finder.session();
  }

  [[nodiscard]] bool running() const noexcept { return haptic_.last_heard() != TimePoint{}; }
  [[nodiscard]] bool fresh() const noexcept {
    return running() && to_seconds(loop_.woke() - haptic_.last_heard()) < stale_s_;
  }

  void act(bool trusted) {
    const TimePoint begin = loop_.woke();
    const DeviceCommand safe =
        guard.pass(command_, device.state(), trusted && device.present() && device.renders_force(), period_s_);
    felt_ = safe.wrench;
    // The path starts with the haptic loop, however long the device has been on.
    if (running()) {
      device.step(safe, period_s_);
    } else {
      device.idle(period_s_);
    }
    if (std::string news = device.news(); !news.empty()) ports.status.note(std::move(news));
    stages_.mark(DeviceStage::advance);
    const DeviceState& state = device.state();
    // Until the haptic loop runs, each sample may be the one that it finds.
    const bool to_all = ++since_shared_ >= shared_every_;
    if (device.present() && (deadband_.sends(state, felt_, period_s_) || !running()) &&
        send_state(begin, state, to_all)) {
      check_.sent(state.sequence, to_ns(begin));
      if (to_all) since_shared_ = 0;
    }
    const TimePoint end = stages_.mark(DeviceStage::send);
    Miss miss = loop_.judge(end, loop_.deadline());
    if (stands_) miss = Miss::none;  // while the run is paused, the force is zero
    // Steps before the haptic loop runs do not count.
    if (running()) {
      measures.step(state, felt_,
                    {.step_s = to_seconds(end - begin), .woken_late_s = loop_.woken_late_s(), .miss = miss});
    }
    loop_.end(end);
    ports.status.update(measures.state(state.stamp_s));
    stages_.mark(DeviceStage::account);
    measures.end_step();
  }

  Stages<DeviceStage>& stages_;
  double rate_hz_, period_s_;
  double stale_s_;       ///< age of a command at which the force fades out
  bool stands_ = false;  ///< the sub-world's time stands: the run is paused
  int shared_every_;     ///< states, of which one goes to all users' programs
  int since_shared_ = 0;
  Deadband<DeviceState> deadband_;
  PacedLoop<DeviceStage> loop_;
  double absent_s_;  ///< age of the newest command from which the haptic process is absent
  bool absent_ = false;
  PeerWatch haptic_;
  CommandCheck check_;
  DeviceCommand command_, came_;
  Wrench felt_;
};

}  // namespace

Ending run_realtime(const DeviceRun& run) {
  const Scheduling scheduling = claim_realtime(priority::kDevice);
  return RealtimeLoop(run).run(scheduling);
}

}  // namespace subworld
