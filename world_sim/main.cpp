#include "rt/cyclic.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "world_sim/run.hpp"

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
    const auto flush = realtime ? History::Flush::rarely : History::Flush::often;

    WorldMeasures measures(options.out, options.trace, flush);
    if (realtime) claim_realtime(priority::kMiddleware);  // the middleware's threads inherit it
    WorldPorts ports(options, scene);
    if (realtime) leave_realtime();
    fmt::print("world_sim: {}\n", ports.bus->effective_settings());
    ports.status.enter("loading");
    World world(scene, [&](double part) { ports.status.done(part); });
    EngineExchange exchange(
        realtime ? EngineExchange::Preparation::in_background : EngineExchange::Preparation::at_once, scene.meshes);
    watch_stop_signals(kLongestEnd_s);  // from here on there is something to end in order
    const TimePoint begin = Clock::now();
    ports.scene.write(world.description(settings_hash(scene)));
    ports.status.enter("settling");
    Progress progress;
    const auto settling = [&](double part) {
      ports.status.done(part);
      return progress(part);
    };
    if (!world.settle(settling)) return;
    const double settle_s = to_seconds(Clock::now() - begin);
    if (gather(ports, options)) {
      if (!realtime) {
        run_lockstep(ports, world, measures, exchange, scene);
      } else {
        run_realtime(ports, world, measures, exchange, scene, options.wait_s);
      }
      ports.status.enter("stopping");
      if (!options.out.empty()) {
        Json json = measures.json(world, scene.bodies.size(), settle_s);
        json["world"]["dds"] = ports.bus->effective_settings();
        json["world"]["events"] = to_json(ports.status.events_of_run());
        write_json(options.out + "/world.json", json);
      }
    }
  });
}
