#pragma once

#include <cstddef>

namespace subworld {

/// Cost of an engine's step, linear in the number of bodies and contacts (paper 4.4, figure 12). In seconds on one core
/// of the machine on which it was measured.
struct StepCost {
  double step_s = 0.0;     ///< of an empty world
  double body_s = 0.0;     ///< for each movable body
  double contact_s = 0.0;  ///< for each contact point

  [[nodiscard]] double of(std::size_t bodies, std::size_t contacts) const noexcept {
    return step_s + body_s * static_cast<double>(bodies) + contact_s * static_cast<double>(contacts);
  }
};

}  // namespace subworld
