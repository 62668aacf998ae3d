#include "model/error.hpp"
#include "program/join.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"
#include "world_sim/loop.hpp"

#include <fmt/format.h>

#include <string>

namespace subworld {

bool await_peers(WorldPorts& ports, const Options& options) {
  ports.status.enter("waiting");
  const TimePoint until = Clock::now() + from_seconds(options.wait_s);
  for (std::size_t u = 0; u < ports.frames.size(); ++u) {
    const Wanted haptic{fmt::format("haptic_sim for user {}", u), fmt::format("haptic_sim --user {}", u)};
    const auto there = [&] { return ports.frames[u].matched() > 0 && ports.reports[u].matched() > 0; };
    if (!wait_for(*ports.bus, options, haptic, there)) return false;
  }
  if (options.await_display) {
    // What only looks may hold up a run, but does not end it.
    const auto looks = [&] { return ports.snapshots.matched() > 0; };
    const auto may_wait = [&] { return stop_signal() == 0 && Clock::now() < until; };
    while (!looks() && may_wait()) ports.bus->wait(0.05);
    if (!looks()) ports.status.note("no display has come: the run goes on without one");
    // One that holds the scene has found this world's other topics too; one that has died never will.
    while (looks() && may_wait() && !ports.scene.wait_for_acknowledgments(0.1)) {
    }
    if (stop_signal() != 0) return false;
  }
  // A process that has found the others' endpoints by now has found another world's too.
  if (const std::string text = ports.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
  ports.status.enter("running");
  return true;
}

}  // namespace subworld
