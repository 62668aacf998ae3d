#include "physics/bullet/solver/bounce_limit.hpp"

namespace subworld::bullet {

namespace {

constexpr btScalar kEnergyRounding = btScalar(1e-5);  ///< of the energy, that is no gain
constexpr btScalar kBeyond = btScalar(0.02);          ///< of a correction, so that few tries remain just above

}  // namespace

btScalar kinetic_energy(const Mover& mover, const Motion& motion) {
  if (mover.body == nullptr || mover.inverse_mass == 0) return 0;
  btScalar twice = vector(motion.linear).length2() / mover.inverse_mass;
  if (mover.inverse_inertia.determinant() != 0) {
    const btVector3 spin = vector(motion.angular);
    twice += spin.dot(mover.inverse_inertia.inverse() * spin);
  }
  return twice / 2;
}

void BounceLimit::begin(std::span<const Mover> movers) {
  movers_ = movers;
  any_ = false;
  sets_.reset(movers.size());
  islands_.assign(movers.size(), {});
}

void BounceLimit::join(std::size_t a, std::size_t b, bool bounces) {
  // Fixed bodies do not connect islands.
  const std::uint32_t one = root(a == kFixed ? b : a), other = root(b == kFixed ? a : b);
  islands_[one].bounces |= bounces || islands_[other].bounces;
  sets_.join(one, other);
  any_ |= bounces;
}

bool BounceLimit::lower(std::span<const Motion> before, std::span<const Motion> after, bool last) {
  for (Island& island : islands_) island.had_j = island.gain_j = 0;
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    Island& island = islands_[root(i)];
    if (!island.bounces) continue;
    const btScalar had_j = kinetic_energy(movers_[i], before[i]);
    island.had_j += had_j;
    island.gain_j += kinetic_energy(movers_[i], after[i]) - had_j;
  }
  bool any = false;
  for (Island& island : islands_) {
    if (!island.bounces || island.factor == 0 || island.gain_j <= kEnergyRounding * island.had_j) continue;
    any = true;
    // First guess: without restitution no gain is left, and the energy grows with the square of the factor.
    btScalar wanted = island.factor * btSqrt(island.had_j / (island.had_j + island.gain_j));
    if (island.tried) {
      const btScalar slope = (island.gain_j - island.last_gain_j) / (island.factor - island.last_factor);
      wanted = slope > 0 ? island.factor - island.gain_j / slope : btScalar(0);
    }
    const btScalar next = wanted - kBeyond * (island.factor - wanted);
    island.last_factor = island.factor;
    island.last_gain_j = island.gain_j;
    island.tried = true;
    island.factor = last || !(next > 0) ? btScalar(0) : next;  // also if a number is not finite
  }
  return any;
}

btScalar BounceLimit::factor(std::size_t a, std::size_t b) noexcept {
  return islands_[root(a == kFixed ? b : a)].factor;
}

}  // namespace subworld::bullet
