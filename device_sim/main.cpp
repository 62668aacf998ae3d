#include "device_sim/driven_device.hpp"
#include "device_sim/drivers.hpp"
#include "device_sim/emulated_device.hpp"
#include "device_sim/run.hpp"
#include "model/error.hpp"
#include "program/leave.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

namespace {

using namespace subworld;

/// The driver that the options name; null: the device is emulated. Throws `Error` (usage).
const DriverPlugin* driver_of(const Options& options, Mode mode) {
  if (options.devices.empty() || options.devices.front() == kEmulated) return nullptr;
  const std::string& name = options.devices.front();
  if (options.devices.size() > 1)
    throw Error(ExitCode::usage, "--device: this program serves one user; name one device");
  if (mode == Mode::lockstep) throw Error(ExitCode::usage, refused_in_lockstep(name));
  return &driver_plugin(name);
}

}  // namespace

int main(int argc, char** argv) {
  return run_program(Program::device_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;
    const auto user = static_cast<std::size_t>(options.user);
    Scene limited = scene;
    const auto number = static_cast<std::uint32_t>(user);
    const DriverPlugin* const driver = driver_of(options, scene.settings.mode);
    std::unique_ptr<Device> device;
    const DrivenDevice* driven = nullptr;
    if (driver != nullptr) {
      DeviceSpec& spec = limited.users[user].device;
      auto opened = std::make_unique<DrivenDevice>(*driver,
                                                   DeviceUse{.settings = options.device_settings,
                                                             .scale_ratio = options.device_scale_ratio,
                                                             .wait_s = options.wait_s,
                                                             .declutch_button = options.device_declutch,
                                                             .domain = options.network.domain},
                                                   spec, number);
      spec = within_limits(spec, opened->capabilities(), driver->name);
      driven = opened.get();
      device = std::move(opened);
    } else {
      device = std::make_unique<EmulatedDevice>(scene.users[user].device, number);
    }
    DeviceGuard guard(limited, user, realtime ? kFadeIn_s : 0.0);
    watch_stop_signals(kLongestEnd_s);  // from here on an orderly end is needed
    if (realtime) lock_memory();
    const std::set<pid_t> before = own_threads();
    DevicePorts ports(options, scene);
    if (realtime) raise_threads_since(before, priority::kMiddleware);
    Leave leave;
    DeviceMeasures measures(options, [&](std::string text) { ports.status.note(std::move(text)); });
    fmt::print("device_sim {}: {}\n", options.user, ports.bus->effective_settings());
    const std::string last =
        options.out.empty() ? "" : fmt::format("{}/last_device_sim_{}.csv", options.out, options.user);
    with_last_words(ports.status, last, [&] {
      SessionFinder finder(ports.scene, scene, ports.status);
      DeviceRun run{options, scene, ports, *device, guard, measures, finder};
      if (const auto session = join(run)) {
        run.session = *session;
        const double from_s = device->state().stamp_s;
        Ending ending =
            ended([&] { return realtime ? run_realtime(run) : run_lockstep(run); },
                  [&] { return Ending{.session = *session, .from_s = from_s, .to_s = device->state().stamp_s}; });
        ports.status.enter("stopping");
        DeviceResult part = measures.result(guard);
        part.dds = ports.bus->effective_settings();
        part.events = ports.status.events_of_run();
        if (driven != nullptr) part.driver = driven->result();
        part.refused = {.device_command = ports.commands.refused(),
                        .forged_command = measures.forged_commands(),
                        .by = ports.commands.foreign_programs()};
        if (ending.fault.empty()) ending.fault = measures.fault();
        conclude(options.out.empty() ? "" : fmt::format("{}/device_{}.json", options.out, options.user), part, ending);
        device.reset();  // zero force, whatever the end of this process
        if (ending.by == kLastCommand) leave.at_once();
      }
    });
  });
}
