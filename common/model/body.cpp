#include "model/body.hpp"

namespace subworld {

Body nameless(const Body& body) noexcept {
  Body copy;
  copy.id = body.id;
  copy.shape = body.shape;
  copy.material = body.material;
  copy.mass = body.mass;
  copy.inertia = body.inertia;
  copy.gravity = body.gravity;
  copy.rotates = body.rotates;
  return copy;
}

bool finite(const BodyState& state) noexcept {
  return state.position.allFinite() && state.orientation.coeffs().allFinite() && state.linear_velocity.allFinite() &&
         state.angular_velocity.allFinite();
}

double kinetic_energy(const Body& body, const BodyState& s) noexcept {
  const Vec3 spin = s.orientation.conjugate() * s.angular_velocity;
  return 0.5 * (body.mass * s.linear_velocity.squaredNorm() + spin.cwiseProduct(body.inertia).dot(spin));
}

}  // namespace subworld
