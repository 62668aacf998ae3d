#pragma once

#include "io/ending.hpp"
#include "world_sim/measures.hpp"
#include "world_sim/ports.hpp"
#include "world_sim/run_control.hpp"
#include "world_sim/world.hpp"

namespace subworld {

/// What both loops of the world process do in a cycle, but for waiting.
class WorldCycle {
 public:
  WorldCycle(WorldPorts& ports, World& world, WorldMeasures& measures, EngineExchange& exchange)
      : ports_(ports), world_(world), measures_(measures), exchange_(exchange) {}

  /// Follows the orders that have come, and changes the engine once the new one is ready.
  void follow_orders();
  /// World::step(), each part of it marked as a stage.
  void step();
  /// Publishes each user's frame; the last one in any case. `start_in_s`: see WorldFrame.
  void publish_frames(bool last, double start_in_s, double real_time_factor);
  /// Throws `Error` (failed) where a body's state is not finite.
  void check_finite() const;
  /// How the run ended.
  [[nodiscard]] Ending ending() const;
  /// The last frames and reports: writes the last states, and waits for readers.
  void close();

  [[nodiscard]] RunControl& control() noexcept { return control_; }

 private:
  void exchange_engine();

  WorldPorts& ports_;
  World& world_;
  WorldMeasures& measures_;
  EngineExchange& exchange_;
  RunControl control_;
};

}  // namespace subworld
