#include "haptic_sim/loops/ports.hpp"

#include "coupling/schemes/scheme.hpp"
#include "model/joined.hpp"
#include "program/leave.hpp"

#include <fmt/core.h>

#include <chrono>
#include <set>
#include <thread>

namespace subworld {

HapticPorts::HapticPorts(const Options& options, const Scene& scene_file)
    : bus(open_bus(options.network, scene_file.settings,
                   scene_file.settings.sample_period_s(scene_file.users[options.user].device.rate_hz),
                   fmt::format("haptic_sim {}", options.user))),
      scene(bus->reader<SceneDescription>()),
      device(bus->reader<DeviceState>(device_partition(options.user))),
      command(bus->writer<DeviceCommand>(device_partition(options.user))),
      control(bus->reader<Control>()),
      frames(bus->reader<WorldFrame>(user_partition(options.user))),
      reports(bus->writer<HapticReport>(user_partition(options.user))),
      status(*bus, ProgramKind::haptic_sim, static_cast<std::uint32_t>(options.user),
             fmt::format("haptic_sim {}", options.user)),
      peer_devices(*bus, scene_file) {
  const std::size_t users = scene_file.users.size();
  if (users < 2 || !scheme_of(scene_file.settings).properties.replicates_peers) return;
  if (scene_file.settings.mode == Mode::realtime) peer_devices.open_in_background();
  if (scene_file.settings.mode == Mode::lockstep) all_devices.emplace(*bus, users, options.user);
}

bool HapticPorts::send(HapticReport& report) noexcept {
  report.session = session;
  report.sender = identity;
  return reports.write(report);
}

std::string HapticPorts::foreign_programs() const {
  std::set<std::string> programs{device.foreign_programs(), frames.foreign_programs()};
  programs.erase("");
  return joined(programs, "; ");
}

void send_last_command(HapticPorts& ports, const DeviceState& state, int times) {
  constexpr std::chrono::milliseconds kAgain{5};
  DeviceCommand command;
  command.device = state.device;
  command.session = ports.session;
  command.served = state.sender;
  command.sequence = state.sequence;
  command.pose = state.pose;
  command.last = true;
  for (int i = 0; i < times; ++i) {
    if (i > 0) std::this_thread::sleep_for(kAgain);
    ports.command.write(command);
  }
  await_arrival(ports.command, ports.status, {ProgramKind::device_sim, state.device}, Clock::now());
}

}  // namespace subworld
