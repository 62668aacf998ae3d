#include "device_sim/run.hpp"
#include "program/leave.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::device_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;

    const auto user = static_cast<std::size_t>(options.user);
    EmulatedDevice device(scene.users[user].device, static_cast<std::uint32_t>(user));
    DeviceGuard guard(scene, user, realtime ? kFadeIn_s : 0.0);
    watch_stop_signals(kLongestEnd_s);                    // from here on an orderly end is needed
    if (realtime) claim_realtime(priority::kMiddleware);  // the middleware's threads inherit it
    DevicePorts ports(options, scene);
    Leave leave;
    if (realtime) leave_realtime();
    DeviceMeasures measures(options, [&](std::string text) { ports.status.note(std::move(text)); });
    fmt::print("device_sim {}: {}\n", options.user, ports.bus->effective_settings());
    const std::string last =
        options.out.empty() ? "" : fmt::format("{}/last_device_sim_{}.csv", options.out, options.user);
    with_last_words(ports.status, last, [&] {
      SessionFinder finder(ports.scene, scene, ports.status);
      DeviceRun run{options, scene, ports, device, guard, measures, finder};
      if (const auto session = join(run)) {
        run.session = *session;
        const double from_s = device.state().stamp_s;
        Ending ending =
            ended([&] { return realtime ? run_realtime(run) : run_lockstep(run); },
                  [&] { return Ending{.session = *session, .from_s = from_s, .to_s = device.state().stamp_s}; });
        ports.status.enter("stopping");
        DeviceResult part = measures.result(guard);
        part.dds = ports.bus->effective_settings();
        part.events = ports.status.events_of_run();
        part.refused = {.device_command = ports.commands.refused(), .by = ports.commands.foreign_programs()};
        if (ending.fault.empty()) ending.fault = measures.fault();
        conclude(options.out.empty() ? "" : fmt::format("{}/device_{}.json", options.out, options.user), part, ending);
        if (ending.by == kLastCommand) leave.at_once();
      }
    });
  });
}
