#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"
#include "world_sim/checkpoint/checkpoint_writer.hpp"
#include "world_sim/loops/loop.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <optional>
#include <string>
#include <vector>

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

/// What --resume asks for; empty: nothing.
std::optional<subworld::WorldCheckpoint> checkpoint_of(const subworld::Options& options, const subworld::Scene& scene) {
  using namespace subworld;
  if (options.resume.empty()) return {};
  if (scene.settings.mode != Mode::realtime) {
    throw Error(ExitCode::usage,
                "--resume: a world resumes in real time only; a lock-step run repeats bit by bit from "
                "t = 0 instead");
  }
  std::vector<std::string> skipped;
  WorldCheckpoint from = read_checkpoint(options.resume, scene, skipped);
  for (const std::string& text : skipped) fmt::print("world_sim: skipped {}\n", text);
  fmt::print("world_sim: resumes at t = {:.3f} s, from {}\n", from.time_s, options.resume);
  if (from.engine != scene.settings.world.name)
    fmt::print("world_sim: engine {} goes on from the states of {}\n", scene.settings.world.name, from.engine);
  return from;
}

/// Lets the world come to rest, or goes on from the checkpoint. False when asked to stop.
bool prepare(subworld::WorldPorts& ports, subworld::World& world, const subworld::WorldCheckpoint* from) {
  ports.status.enter("settling");
  if (from != nullptr) {
    world.resume(*from);
    return true;
  }
  Progress progress;
  return world.settle([&](double part) {
    ports.status.done(part);
    return progress(part);
  });
}

/// The run, and its results.
void run_world(const subworld::WorldRun& run, const std::optional<subworld::WorldCheckpoint>& from, double settle_s) {
  using namespace subworld;
  const auto& [options, scene, ports, world, measures, exchange, checkpoints, awaited] = run;
  const bool realtime = scene.settings.mode == Mode::realtime;
  const double from_s = world.facts().time_s;
  Ending ending =
      ended([&] { return realtime ? run_realtime(run) : run_lockstep(run); },
            [&] { return Ending{.session = ports.session, .from_s = from_s, .to_s = world.facts().time_s}; });
  ports.status.enter("stopping");  // the launcher does not start it again
  fmt::print("world_sim: the run is over at t = {:.3f} s\n", ending.to_s);
  std::fflush(stdout);
  WorldPart part = measures.result(world, settle_s);
  part.world.checkpoints = checkpoints.result();
  if (from) part.world.resumed_from_s = from_s;
  part.arguments = settings_flags_of(options);
  part.world.dds = ports.bus->effective_settings();
  part.world.events = ports.status.events_of_run();
  part.world.refused = ports.refused();
  if (ending.fault.empty()) ending.fault = measures.fault();
  conclude(options.out.empty() ? "" : options.out + "/world.json", part, ending);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::world_sim, argc, argv, [](const Options& options, const Scene& scene) {
    const bool realtime = scene.settings.mode == Mode::realtime;
    check_without(options, scene);
    const std::optional<WorldCheckpoint> from = checkpoint_of(options, scene);
    const std::optional<Scene> resumed = from ? std::optional(resumed_scene(scene, *from)) : std::nullopt;

    if (realtime) lock_memory();
    const std::set<pid_t> before = own_threads();
    WorldPorts ports(options, scene);
    if (realtime) raise_threads_since(before, priority::kMiddleware);
    const auto say = [&](std::string text) { ports.status.note(std::move(text)); };
    WorldMeasures measures(options, scene, say);
    if (from && options.resume == options.out) measures.goes_back();
    fmt::print("world_sim: {}\n", ports.bus->effective_settings());
    const std::string last = options.out.empty() ? "" : options.out + "/last_world_sim.csv";
    with_last_words(ports.status, last, [&] {
      ports.status.enter("loading");
      World world(resumed ? *resumed : scene, [&](double part) { ports.status.done(part); });
      EngineExchange exchange(
          realtime ? EngineExchange::Preparation::in_background : EngineExchange::Preparation::at_once, scene.meshes,
          scene.joints);
      watch_stop_signals(kLongestEnd_s);  // from here on there is something to end in order
      const TimePoint began = Clock::now();
      ports.describe(scene, world.engine());
      if (from) measures.resume(from->absences);
      if (!prepare(ports, world, from ? &*from : nullptr)) return;
      const double settle_s = to_seconds(Clock::now() - began);
      const std::vector<bool> awaited = awaited_users(options, scene, measures.absences());
      if (!await_peers(ports, options, awaited)) return;
      CheckpointWriter checkpoints(options, scene, world, ports.session, say);
      run_world({options, scene, ports, world, measures, exchange, checkpoints, awaited}, from, settle_s);
    });
  });
}
