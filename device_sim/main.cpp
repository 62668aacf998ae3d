#include "device_sim/run.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::device_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;
    const auto flush = realtime ? History::Flush::rarely : History::Flush::often;

    const UserSpec& user = scene.users[static_cast<std::size_t>(options.user)];
    EmulatedDevice device(user.device, static_cast<std::uint32_t>(options.user));
    DeviceMeasures measures(options.out, options.trace, options.user, flush);
    watch_stop_signals(kLongestEnd_s);                    // from here on there is something to end in order
    if (realtime) claim_realtime(priority::kMiddleware);  // the middleware's threads inherit it
    DevicePorts ports(options, scene);
    if (realtime) leave_realtime();
    fmt::print("device_sim {}: {}\n", options.user, ports.bus->effective_settings());
    if (join(ports, options)) {
      if (!realtime) {
        run_lockstep(ports, device, measures, scene);
      } else {
        run_realtime(ports, device, measures, user, from_seconds(options.spin_s));
      }
      ports.status.enter("stopping");
      if (!options.out.empty()) {
        Json json = measures.json();
        json["dds"] = ports.bus->effective_settings();
        json["events"] = to_json(ports.status.events_of_run());
        write_json(fmt::format("{}/device_{}.json", options.out, options.user), json);
      }
    }
  });
}
