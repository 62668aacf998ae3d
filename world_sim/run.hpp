#pragma once

#include "io/ending.hpp"
#include "world_sim/measures.hpp"
#include "world_sim/ports.hpp"
#include "world_sim/world.hpp"

namespace subworld {

/// Waits until every user's haptic process has joined. False when asked to stop. Throws `Error` (failed) that names
/// who is missing.
[[nodiscard]] bool await_peers(WorldPorts& ports, const Options& options);

/// Each cycle waits for every user's report. Throws `Error` (failed) when a haptic process dies or is started again, or
/// the world is no longer finite.
[[nodiscard]] Ending run_lockstep(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                                  const Scene& scene);

/// The clock starts when every haptic process has answered, or throws `Error` (failed) after `wait_s` seconds. Absolute
/// deadlines; reports are used as they come. A world that cannot keep up slows its clock, not its step. It goes on for
/// those users who are there, until none is left; that others have gone is a fault.
[[nodiscard]] Ending run_realtime(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                                  const Scene& scene, double wait_s);

}  // namespace subworld
