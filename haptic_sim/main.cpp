#include "haptic_sim/loops/run.hpp"
#include "program/leave.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::haptic_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;

    SubWorld sub(scene, static_cast<std::size_t>(options.user));
    EngineExchange exchange(
        realtime ? EngineExchange::Preparation::in_background : EngineExchange::Preparation::at_once, scene.meshes,
        scene.joints);
    watch_stop_signals(kLongestEnd_s);  // from here on there is something to end in order
    if (realtime) lock_memory();
    const std::set<pid_t> before = own_threads();
    HapticPorts ports(options, scene);
    if (realtime) raise_threads_since(before, priority::kMiddleware);
    Leave leave;
    HapticMeasures measures(options, scene, [&](std::string text) { ports.status.note(std::move(text)); });
    fmt::print("haptic_sim {}: {}\n", options.user, ports.bus->effective_settings());
    const std::string last =
        options.out.empty() ? "" : fmt::format("{}/last_haptic_sim_{}.csv", options.out, options.user);
    with_last_words(ports.status, last, [&] {
      SessionFinder finder(ports.scene, scene, ports.status);
      const HapticRun run{options, scene, ports, sub, measures, exchange, finder};
      if (const auto first = join(run)) {
        // What the start took depends on when the others came.
        const auto bytes = [&] { return ports.frames.received_bytes() + ports.reports.sent_bytes(); };
        const std::uint64_t bytes_before = bytes();
        const double from_s = sub.facts().time_s;
        if (from_s > (realtime ? kAbsent_s : 0.0)) measures.joins_late();
        const auto so_far = [&] {
          const double to_s = measures.is_accepted() ? sub.facts().time_s : from_s;
          return Ending{.session = ports.session, .from_s = from_s, .to_s = to_s};
        };
        Ending ending = ended([&] { return realtime ? run_realtime(run, *first) : run_lockstep(run, *first); }, so_far);
        ports.status.enter("stopping");
        const double cycles =
            std::max(1.0, static_cast<double>(sub.facts().stamp) - static_cast<double>(first->frame.stamp));
        HapticResult part = measures.result(sub, static_cast<double>(bytes() - bytes_before) / cycles);
        part.dds = ports.bus->effective_settings();
        part.events = ports.status.events_of_run();
        part.refused = {.device_state = ports.device.refused(),
                        .world_frame = ports.frames.refused(),
                        .by = ports.foreign_programs()};
        if (ending.fault.empty()) ending.fault = measures.fault();
        conclude(options.out.empty() ? "" : fmt::format("{}/haptic_{}.json", options.out, options.user), part, ending);
        if (ending.by == kLastFrame) leave.at_once();
      }
    });
  });
}
