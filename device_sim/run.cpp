#include "device_sim/run.hpp"

#include "model/error.hpp"
#include "rt/paced_loop.hpp"
#include "rt/presence.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "wire/partitions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

constexpr double kStale_s = 0.005;  ///< age of a command at which the force fades out

}  // namespace

DevicePorts::DevicePorts(const Options& options, const Scene& scene_file)
    : bus(open_bus(options.network, scene_file.settings,
                   1.0 / scene_file.users[static_cast<std::size_t>(options.user)].device.rate_hz,
                   fmt::format("device_sim {}", options.user))),
      scene(bus->reader<SceneDescription>()),
      states(bus->writer<DeviceState>(device_partition(options.user))),
      commands(bus->reader<DeviceCommand>(device_partition(options.user))),
      status(*bus, ProgramKind::device_sim, static_cast<std::uint32_t>(options.user),
             fmt::format("device_sim {}", options.user)) {}

DeviceMeasures::DeviceMeasures(const std::string& folder, const std::string& trace, int user, const History::Say& say)
    : user_(user),
      history_(folder.empty() ? "" : fmt::format("{}/device_{}.csv", folder, user),
               {"time_s",
                "x_m",
                "y_m",
                "z_m",
                "velocity_x_m_s",
                "velocity_y_m_s",
                "velocity_z_m_s",
                "force_x_n",
                "force_y_n",
                "force_z_n",
                "qw",
                "qx",
                "qy",
                "qz",
                "angular_velocity_x_rad_s",
                "angular_velocity_y_rad_s",
                "angular_velocity_z_rad_s",
                "torque_x_n_m",
                "torque_y_n_m",
                "torque_z_n_m"},
               say),
      trace_(trace, {fmt::format("device_sim {}", user), 200 + user}, kDeviceStages, say) {}

void DeviceMeasures::end_step() noexcept {
  const StageStep step = stages_.end();
  if (newest_missed_) trace_.instant(Trace::Name::missed_deadline, step.begin);
  trace_.step(step);
}

void DeviceMeasures::step(const DeviceState& state, const Wrench& wrench, const StepTimes& times) noexcept {
  ++steps_;
  misses_.add(times.miss);
  step_.add(times.step_s);
  woken_late_.add(times.woken_late_s);
  newest_missed_ = times.miss != Miss::none;
  const Vec3& x = state.pose.position;
  const Vec3& v = state.linear_velocity;
  const Vec3& f = wrench.force;
  const Quat& q = state.pose.orientation;
  const Vec3& w = state.angular_velocity;
  const Vec3& torque = wrench.torque;
  history_.row({state.stamp_s, x.x(), x.y(), x.z(), v.x(), v.y(), v.z(), f.x(),      f.y(),      f.z(),
                q.w(),         q.x(), q.y(), q.z(), w.x(), w.y(), w.z(), torque.x(), torque.y(), torque.z()});
}

DeviceResult DeviceMeasures::result(const DeviceGuard& guard) {
  history_.finish();
  return {.user = static_cast<std::size_t>(user_),
          .steps = steps_,
          .round_trip_s = quantiles(round_trip_),
          .missed_deadlines = misses_.all(),
          .missed_by_os = misses_.by_os,
          .missed_by_run = misses_.by_run,
          .step_s = quantiles(step_),
          .operator_energy = {guard.port().net_j(), guard.port().least_j(), guard.port().created_j()},
          .energy_bounded_ratio = guard.bounded_ratio(),
          .oscillation_n = guard.oscillation().worst_n(),
          .woken_late_s = quantiles(woken_late_),
          .machine = machine_,
          .stages = subworld::stages(stages_.times(), kDeviceStages),
          .trace_events_dropped = trace_.dropped()};
}

std::optional<std::uint64_t> join(DevicePorts& ports, const Scene& scene, const Options& options) {
  ports.status.enter("waiting");
  SessionFinder finder(ports.scene, settings_hash(scene));
  TimePoint hope = Clock::now();
  const auto held = [&] { return ports.states.matched() > 0 && ports.commands.matched() > 0; };
  while (!finder.look(options.scene, options.network.domain) || !held()) {
    if (stop_signal() != 0) return std::nullopt;
    // A world may take long to load; its status arrives every second.
    if (finder.session() == 0 && ports.status.hears(ProgramKind::world_sim, 0)) hope = Clock::now();
    if (to_seconds(Clock::now() - hope) > options.wait_s) {
      const auto missing = [&](const char* what, const std::string& program) {
        return fmt::format(
            "no {} on domain {} within {} s; start {} with the same --domain; on another host, name it with --peers "
            "and "
            "give --interface on both",
            what, options.network.domain, options.wait_s, program);
      };
      throw Error(ExitCode::failed, finder.session() == 0
                                        ? missing("world", "world_sim")
                                        : missing(fmt::format("haptic_sim for user {}", options.user).c_str(),
                                                  fmt::format("haptic_sim --user {}", options.user)));
    }
    ports.bus->wait(0.05);
  }
  ports.status.enter("running");
  return finder.session();
}

Ending run_lockstep(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard, DeviceMeasures& measures,
                    const Scene& scene, std::uint64_t session) {
  Ending ending{.session = session, .from_s = device.state().stamp_s, .by = "last command"};
  DeviceCommand command;
  const Peer haptic{ProgramKind::haptic_sim, device.state().device};
  const auto stopped = [] { return stop_signal() != 0; };
  Stages<DeviceStage>& stages = measures.stages();
  stages.begin();
  while (true) {
    DeviceState state = device.state();
    const TimePoint sent = Clock::now();
    state.session = session;
    state.sender = ports.identity;
    state.sent_ns = to_ns(sent);
    if (!ports.states.write(state))
      throw Error(ExitCode::failed, unsent_text("device_state", ports.commands, ports.status, haptic));
    stages.mark(DeviceStage::send);
    const auto ours = [&](const DeviceCommand& came) {
      return came.session == session && came.served == ports.identity && (came.last || came.sequence == state.sequence);
    };
    ending.to_s = state.stamp_s;
    if (!await(*ports.bus, ports.status, ports.commands, command, stages, haptic, ours, stopped)) {
      ending.by = name_of_signal(stop_signal());
      return ending;
    }
    if (command.served == ports.identity) ports.commands.trust_sender();
    if (command.last) return ending;
    measures.round_trip(1e-9 * static_cast<double>(to_ns(stages.now()) - command.echoed_sent_ns));
    const DeviceCommand safe = guard.pass(command, state, true, scene.settings.h_s);
    device.step(safe, scene.settings.h_s);
    stages.mark(DeviceStage::advance);
    measures.step(state, safe.wrench, {to_seconds(stages.now() - sent)});
    ports.status.update(measures.state(state.stamp_s));
    stages.mark(DeviceStage::account);
    measures.end_step();
  }
}

namespace {

/// The device process in real time: at the device's own rate, with the newest command.
class RealtimeLoop {
 public:
  RealtimeLoop(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard, DeviceMeasures& measures,
               double period_s, std::uint64_t session, Duration spin)
      : ports_(ports),
        device_(device),
        guard_(guard),
        measures_(measures),
        stages_(measures.stages()),
        period_s_(period_s),
        session_(session),
        haptic_sim_{ProgramKind::haptic_sim, device.state().device},
        loop_(Clock::now(), period_s, spin, stages_) {}

  Ending run(const Scheduling& scheduling) {
    Ending ending{.session = session_, .from_s = device_.state().stamp_s, .by = "last command"};
    measures_.loop_begins(scheduling);
    while (stop_signal() == 0 && ending.fault.empty()) {
      wake();
      receive();
      if (command_.last) break;
      ending.fault = watch();
      if (ending.fault.empty()) act(fresh());
    }
    // The commands with which the haptic loop fades the force may have arrived late or not at all.
    while (!felt_.force.isZero() || !felt_.torque.isZero()) {
      wake();
      act(false);
    }
    measures_.loop_ends();
    ending.to_s = device_.state().stamp_s;
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
    if (to_seconds(loop_.woke() - loop_.deadline()) > kStale_s) (void)loop_.skip_missed();
    loop_.begin();
  }

  void receive() {
    const TimePoint now = loop_.woke();
    const std::uint64_t refused = ports_.commands.refused();
    while (take(ports_.commands, came_, stages_) == Take::sample) {
      foreign_ = came_.session != session_ || (came_.served != ports_.identity && !(came_.last && came_.served == 0));
      if (foreign_) continue;
      if (came_.served == ports_.identity) ports_.commands.trust_sender();
      command_ = came_;
      if (command_.echoed_sent_ns != 0)
        measures_.round_trip(1e-9 * static_cast<double>(to_ns(now) - command_.echoed_sent_ns));
      heard_ = now;
    }
    foreign_ = foreign_ || (heard_ != now && ports_.commands.refused() > refused);
  }

  /// The fault text if the haptic process has gone; empty otherwise.
  std::string watch() {
    const bool alive_now = !foreign_ && alive(ports_.commands, ports_.status, haptic_sim_);
    haptic_.observe(heard_ == loop_.woke(), alive_now, period_s_);
    if (!haptic_.gone()) return {};
    return foreign_ ? replaced_text(haptic_sim_.program, haptic_sim_.instance)
                    : gone_text(haptic_sim_.program, haptic_sim_.instance);
  }

  [[nodiscard]] bool running() const noexcept { return heard_ != TimePoint{}; }
  [[nodiscard]] bool fresh() const noexcept {
    return running() && to_seconds(loop_.woke() - heard_) < std::max(kStale_s, 5.0 * period_s_);
  }

  void act(bool trusted) {
    const TimePoint begin = loop_.woke();
    const DeviceCommand safe = guard_.pass(command_, device_.state(), trusted, period_s_);
    felt_ = safe.wrench;
    // The path starts with the haptic loop, however long the device has been on.
    if (running()) device_.step(safe, period_s_);
    stages_.mark(DeviceStage::advance);
    DeviceState state = device_.state();
    state.session = session_;
    state.sender = ports_.identity;
    state.sent_ns = to_ns(begin);
    ports_.states.write(state);
    const TimePoint end = stages_.mark(DeviceStage::send);
    const Miss miss = loop_.judge(end, loop_.deadline());
    // Steps before the haptic loop runs do not count.
    if (running()) {
      measures_.step(state, felt_,
                     {.step_s = to_seconds(end - begin), .woken_late_s = loop_.woken_late_s(), .miss = miss});
    }
    loop_.end(end);
    ports_.status.update(measures_.state(state.stamp_s));
    stages_.mark(DeviceStage::account);
    measures_.end_step();
  }

  DevicePorts& ports_;
  EmulatedDevice& device_;
  DeviceGuard& guard_;
  DeviceMeasures& measures_;
  Stages<DeviceStage>& stages_;
  double period_s_;
  std::uint64_t session_;
  Peer haptic_sim_;
  PacedLoop<DeviceStage> loop_;
  Presence haptic_;
  DeviceCommand command_, came_;
  TimePoint heard_{};
  Wrench felt_;
  bool foreign_ = false;  ///< the newest command was for another device, or of another run or haptic process
};

}  // namespace

Ending run_realtime(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard, DeviceMeasures& measures,
                    const UserSpec& user, std::uint64_t session, Duration spin) {
  const Scheduling scheduling = claim_realtime(priority::kDevice);
  fmt::print("device_sim {}: {:.0f} Hz, {}\n", device.state().device, user.device.rate_hz, scheduling.text);
  std::fflush(stdout);
  return RealtimeLoop(ports, device, guard, measures, 1.0 / user.device.rate_hz, session, spin).run(scheduling);
}

}  // namespace subworld
