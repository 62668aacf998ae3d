#include "rt/cyclic.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "world_sim/loop.hpp"

#include <fmt/format.h>
#include <unistd.h>

namespace {

/// Progress of the settling: on one line on a terminal, in quarters elsewhere.
class Progress {
 public:
  bool operator()(double part) {
    const int percent = static_cast<int>(100.0 * part);
    if (percent >= shown_ + (terminal_ ? 1 : 25)) {
      shown_ = percent;
      fmt::print("{}world_sim: settling {:3d} %{}", terminal_ ? "\r" : "", percent,
                 terminal_ && percent < 100 ? "" : "\n");
      std::fflush(stdout);
    }
    return subworld::stop_signal() == 0;
  }

 private:
  bool terminal_ = isatty(STDOUT_FILENO) != 0;
  int shown_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::world_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;

    if (realtime) claim_realtime(priority::kMiddleware);  // the middleware's threads inherit it
    WorldPorts ports(options, scene);
    if (realtime) leave_realtime();
    WorldMeasures measures(options, scene, [&](std::string text) { ports.status.note(std::move(text)); });
    fmt::print("world_sim: {}\n", ports.bus->effective_settings());
    with_last_words(ports.status, [&] {
      ports.status.enter("loading");
      World world(scene, [&](double part) { ports.status.done(part); });
      EngineExchange exchange(
          realtime ? EngineExchange::Preparation::in_background : EngineExchange::Preparation::at_once, scene.meshes);
      watch_stop_signals(kLongestEnd_s);  // from here on there is something to end in order
      const TimePoint begin = Clock::now();
      ports.describe(scene, world.engine());
      ports.status.enter("settling");
      Progress progress;
      const auto settling = [&](double part) {
        ports.status.done(part);
        return progress(part);
      };
      if (!world.settle(settling)) return;
      const double settle_s = to_seconds(Clock::now() - begin);
      if (await_peers(ports, options)) {
        const WorldRun run{options, scene, ports, world, measures, exchange};
        Ending ending = ended([&] { return realtime ? run_realtime(run) : run_lockstep(run); },
                              [&] { return Ending{.session = ports.session, .to_s = world.facts().time_s}; });
        ports.status.enter("stopping");
        WorldPart part = measures.result(world, settle_s);
        part.arguments = settings_flags_of(options);
        part.world.dds = ports.bus->effective_settings();
        part.world.events = ports.status.events_of_run();
        part.world.refused = ports.refused();
        if (ending.fault.empty()) ending.fault = measures.fault();
        conclude(options.out.empty() ? "" : options.out + "/world.json", part, ending);
      }
    });
  });
}
