#include "device_sim/run.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/lateness.hpp"
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

Json DeviceMeasures::json(const DeviceGuard& guard) {
  history_.finish();
  return {{"user", user_},
          {"steps", steps_},
          {"round_trip_s", quantiles(round_trip_)},
          {"missed_deadlines", misses_.all()},
          {"missed_by_os", misses_.by_os},
          {"missed_by_run", misses_.by_run},
          {"step_s", quantiles(step_)},
          {"operator_energy", operator_energy(guard.port().net_j(), guard.port().least_j(), guard.port().created_j())},
          {"energy_bounded_ratio", guard.bounded_ratio()},
          {"oscillation_n", guard.oscillation().worst_n()},
          {"woken_late_s", quantiles(woken_late_)},
          {"machine", machine_.json()},
          {"stages", subworld::stages(stages_.times(), kDeviceStages)},
          {"trace_events_dropped", trace_.dropped()}};
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
            "no {} on domain {} within {} s; start {} with the same --domain, or name its host with "
            "--peers",
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

Ending run_realtime(DevicePorts& ports, EmulatedDevice& device, DeviceGuard& guard, DeviceMeasures& measures,
                    const UserSpec& user, std::uint64_t session, Duration spin) {
  const double period_s = 1.0 / user.device.rate_hz;
  const Scheduling scheduling = claim_realtime(priority::kDevice);
  fmt::print("device_sim {}: {:.0f} Hz, {}\n", device.state().device, user.device.rate_hz, scheduling.text);
  std::fflush(stdout);

  Ending ending{.session = session, .from_s = device.state().stamp_s, .by = "last command"};
  DeviceCommand command, came;
  const Peer haptic_sim{ProgramKind::haptic_sim, device.state().device};
  Presence haptic;
  TimePoint heard{};
  Wrench felt;
  Stages<DeviceStage>& stages = measures.stages();
  Cyclic loop(Clock::now(), from_seconds(period_s), spin);
  Lateness lateness(thread_use());
  measures.loop_begins(scheduling);
  const auto wake = [&] {
    const TimePoint asked = Clock::now();
    loop.wait();
    const TimePoint woke = Clock::now();
    lateness.begin(loop.released(), asked, woke, from_seconds(period_s));
    // A device that was suspended did not move meanwhile: it does not catch up.
    if (to_seconds(woke - loop.deadline()) > kStale_s) {
      (void)loop.skip(woke);
      lateness.skipped_to(loop.released());
    }
    stages.begin(loop.released(), woke);
    return woke;
  };
  const auto act = [&](bool trusted, TimePoint begin) {
    const DeviceCommand safe = guard.pass(command, device.state(), trusted, period_s);
    felt = safe.wrench;
    // The path starts with the haptic loop, however long the device has been on.
    if (heard != TimePoint{}) device.step(safe, period_s);
    stages.mark(DeviceStage::advance);
    DeviceState state = device.state();
    state.session = session;
    state.sender = ports.identity;
    state.sent_ns = to_ns(begin);
    ports.states.write(state);
    const TimePoint end = stages.mark(DeviceStage::send);
    const ThreadUse use = thread_use();
    const Miss miss = lateness.judge(end, loop.deadline(), use);
    // Steps before the haptic loop runs do not count.
    if (heard != TimePoint{}) {
      measures.step(state, felt,
                    {.step_s = to_seconds(end - begin), .woken_late_s = lateness.woken_late_s(), .miss = miss});
    }
    lateness.end(end, use);
    ports.status.update(measures.state(state.stamp_s));
    stages.mark(DeviceStage::account);
    measures.end_step();
  };
  bool foreign = false;  // the newest command was for another device, or of another run or haptic process
  while (stop_signal() == 0) {
    const TimePoint begin = wake();
    const std::uint64_t refused = ports.commands.refused();
    while (take(ports.commands, came, stages) == Take::sample) {
      foreign = came.session != session || (came.served != ports.identity && !(came.last && came.served == 0));
      if (foreign) continue;
      if (came.served == ports.identity) ports.commands.trust_sender();
      command = came;
      if (command.echoed_sent_ns != 0)
        measures.round_trip(1e-9 * static_cast<double>(to_ns(begin) - command.echoed_sent_ns));
      heard = begin;
    }
    foreign = foreign || (heard != begin && ports.commands.refused() > refused);
    if (command.last) break;
    haptic.observe(heard == begin, !foreign && alive(ports.commands, ports.status, haptic_sim), period_s);
    if (haptic.gone()) {
      ending.fault = foreign ? replaced_text(ProgramKind::haptic_sim, device.state().device)
                             : gone_text(ProgramKind::haptic_sim, device.state().device);
      break;
    }
    const bool fresh = heard != TimePoint{} && to_seconds(begin - heard) < std::max(kStale_s, 5.0 * period_s);
    act(fresh, begin);
  }
  // The haptic loop's own fading commands may have arrived late or not at all.
  while (!felt.force.isZero() || !felt.torque.isZero()) act(false, wake());
  measures.loop_ends();
  ending.to_s = device.state().stamp_s;
  if (!ending.fault.empty()) {
    ending.by = "fault";
  } else if (!command.last) {
    ending.by = name_of_signal(stop_signal());
  }
  return ending;
}

}  // namespace subworld
