#pragma once

#include "haptic_sim/measures.hpp"
#include "haptic_sim/ports.hpp"
#include "haptic_sim/sub_world.hpp"

namespace subworld {

/// Follows orders to change the sub-world's engine, between two steps and without waiting.
class EngineOrders {
 public:
  EngineOrders(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange)
      : ports_(ports), sub_(sub), measures_(measures), exchange_(exchange) {}

  /// Once a step.
  void follow();

 private:
  HapticPorts& ports_;
  SubWorld& sub_;
  HapticMeasures& measures_;
  EngineExchange& exchange_;
  Control order_;
};

}  // namespace subworld
