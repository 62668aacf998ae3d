// Bounces that would gain energy from Newton's restitution together with friction.

#include "model/shapes/mass_properties.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

namespace subworld {
namespace {

class BulletBounce : public testing::TestWithParam<test::Tested> {
 protected:
  BulletBounce() : engine(GetParam().make()) {}

  void add(const Shape& shape, double mass, const BodyState& state) {
    Body body;
    body.id = BodyId{static_cast<std::uint32_t>(bodies.size())};
    body.shape = shape;
    body.mass = mass;
    body.material = {.friction = 1.34, .restitution = 0.99};
    if (mass > 0.0) body.inertia = principal_inertia(shape, mass);
    engine->add(body, state);
    bodies.push_back(body);
  }
  void add_brick(const Vec3& position, const Vec3& velocity) {
    BodyState state;
    state.position = position;
    state.linear_velocity = velocity;
    add({.kind = ShapeKind::box, .half_extents = {0.0277, 0.0402, 0.03545}}, 1.0, state);
  }
  [[nodiscard]] double energy_j() const {
    double sum = 0.0;
    for (const Body& body : bodies) {
      if (body.fixed()) continue;
      const BodyState s = engine->state(body.id);
      sum += kinetic_energy(body, s) + body.mass * test::kG * s.position.z();
    }
    return sum;
  }
  /// Rise above the initial energy, relative to the initial kinetic energy.
  [[nodiscard]] double largest_gain(double kinetic_j) {
    const double start_j = energy_j();
    double gain = 0.0;
    for (int i = 0; i < GetParam().steps(0.5); ++i) {
      engine->step(GetParam().dt);
      gain = std::max(gain, (energy_j() - start_j) / kinetic_j);
    }
    return gain;
  }

  std::unique_ptr<Engine> engine;
  std::vector<Body> bodies;
};

/// Without the limit, `fast` doubles their energy.
TEST_P(BulletBounce, BricksThatCollideWithFrictionGainNoEnergy) {
  add({.kind = ShapeKind::plane}, 0.0, {});
  const Vec3 fast(0.817, 0.287, -0.438), slow(-0.261, 0.119, 0.344);
  add_brick({0.08312, 0, 0.03545}, fast);
  add_brick({0.1385362, 0, 0.03545}, slow);
  add_brick({0.1662, 0, 0.1064}, Vec3::Zero());
  EXPECT_LT(largest_gain(0.5 * (fast.squaredNorm() + slow.squaredNorm())), 0.05);
}

/// The limit does not remove energy where none is gained.
TEST_P(BulletBounce, AFlatCubeBouncesAsHighAsItShould) {
  add({.kind = ShapeKind::plane}, 0.0, {});
  add_brick({0, 0, 0.03545 + 0.1}, Vec3::Zero());
  double up_m_s = 0.0;
  for (int i = 0; i < GetParam().steps(0.2); ++i) {
    engine->step(GetParam().dt);
    up_m_s = std::max(up_m_s, engine->state(BodyId{1}).linear_velocity.z());
  }
  EXPECT_NEAR(up_m_s, 0.99 * std::sqrt(2.0 * test::kG * 0.1), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Bullets, BulletBounce,
                         testing::Values(test::Tested{"bullet", "fast", 1e-3}, test::Tested{"bullet", "quality", 1e-3},
                                         test::Tested{"bullet_float", "fast", 1e-3},
                                         test::Tested{"bullet_float", "quality", 1e-3}),
                         test::name_of);

}  // namespace
}  // namespace subworld
