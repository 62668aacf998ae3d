#pragma once

#include "world_sim/measures.hpp"
#include "world_sim/ports.hpp"
#include "world_sim/world.hpp"

namespace subworld {

/// Waits until every user's haptic process has joined. False when asked to stop. Throws `Error` (failed) that names
/// who is missing.
[[nodiscard]] bool gather(WorldPorts& ports, const Options& options);

/// Each cycle waits for every user's report. Throws `Error` (failed) when a haptic process dies or the world is no
/// longer finite.
void run_lockstep(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                  const Scene& scene);

/// The clock starts when every haptic process has answered, or throws `Error` (failed) after `wait_s` seconds. Absolute
/// deadlines; reports are used as they come. A world that cannot keep up slows its clock, not its step.
void run_realtime(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange,
                  const Scene& scene, double wait_s);

}  // namespace subworld
