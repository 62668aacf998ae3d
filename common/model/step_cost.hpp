#pragma once

#include <cstddef>

namespace subworld {

/// What a step of an engine costs, linear in what it simulates (paper 4.4, figure 12). s of one core of the machine on
/// which it was measured.
struct StepCost {
  double step_s = 0.0;     ///< without any body
  double body_s = 0.0;     ///< for each movable body
  double contact_s = 0.0;  ///< for each contact point

  [[nodiscard]] double of(std::size_t bodies, std::size_t contacts) const noexcept {
    return step_s + body_s * static_cast<double>(bodies) + contact_s * static_cast<double>(contacts);
  }
};

}  // namespace subworld
