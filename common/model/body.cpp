#include "model/body.hpp"

namespace subworld {

bool finite(const BodyState& state) noexcept {
  return state.position.allFinite() && state.orientation.coeffs().allFinite() && state.linear_velocity.allFinite() &&
         state.angular_velocity.allFinite();
}

}  // namespace subworld
