// Bodies of several parts rest, hold others inside and slide as their parts say, in the engines that have them.
#include "model/error.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/mass_properties.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace subworld {
namespace {

using test::at;
using test::cube;
using test::floor_plane;
using test::kBody;
using test::kFloor;
using test::kOther;

constexpr Material kRough{.friction = 0.5}, kSmooth{.friction = 0.0};

WeightedPart part(const Vec3& half, const Vec3& where, double mass, const Material& material = kRough) {
  const Shape box{.kind = ShapeKind::box, .half_extents = half};
  return {{box, {.position = where}, material}, mass, principal_inertia(box, mass)};
}

/// 80 mm high legs under a top of 20 mm; its frame is on the ground.
Compound table() {
  std::vector<WeightedPart> parts{part({0.1, 0.1, 0.01}, {0, 0, 0.09}, 0.4)};
  for (const double x : {-0.09, 0.09})
    for (const double y : {-0.09, 0.09}) parts.push_back(part({0.01, 0.01, 0.04}, {x, y, 0.04}, 0.1));
  return assemble(parts, {});
}

/// A floor of 10 mm with four walls of 50 mm around 160 mm x 160 mm.
Compound tray() {
  std::vector<WeightedPart> parts{part({0.09, 0.09, 0.005}, {0, 0, 0.005}, 0.4)};
  for (const double side : {-0.085, 0.085}) {
    parts.push_back(part({0.005, 0.09, 0.025}, {side, 0, 0.035}, 0.1));
    parts.push_back(part({0.08, 0.005, 0.025}, {0, side, 0.035}, 0.1));
  }
  return assemble(parts, {});
}

Body body_of(BodyId id, const Compound& compound, std::uint32_t mesh = 0) {
  Body body = cube(id);
  body.shape = {.kind = ShapeKind::compound, .mesh = mesh};
  body.mass = compound.mass;
  body.inertia = compound.inertia;
  return body;
}

class CompoundBody : public testing::TestWithParam<test::Tested> {
 protected:
  void expect_at_rest(const Engine& engine, BodyId id, const BodyState& start) const {
    const BodyState end = engine.state(id);
    EXPECT_LT((end.position - start.position).norm(), 1e-4);
    EXPECT_LT(end.orientation.angularDistance(start.orientation), 1e-3);
    EXPECT_LT(end.linear_velocity.norm(), 1e-3);
  }
  double dt = GetParam().dt;
};

TEST_P(CompoundBody, ATableStandsOnItsLegs) {
  const Compound compound = table();
  const auto engine = GetParam().make(std::vector{compound.mesh});
  engine->add(floor_plane(kFloor), {});
  const BodyState start = at(0.3, 0.2, compound.frame.position.z());
  engine->add(body_of(kBody, compound), start);
  const Box bounds = engine->bounds(kBody);
  EXPECT_NEAR(bounds.lower.z(), 0.0, 1e-6);
  EXPECT_NEAR(bounds.upper.x(), 0.4, 1e-6);
  test::run(*engine, GetParam().steps(1.0), dt);
  expect_at_rest(*engine, kBody, start);
  double normal = 0.0;
  for (int i = 0; i < 50; ++i) {
    engine->step(dt);
    normal += test::totals(*engine, kBody).normal;
  }
  EXPECT_NEAR(normal / (50 * dt), compound.mass * test::kG, 0.01 * compound.mass * test::kG);
}

TEST_P(CompoundBody, OneTableStandsOnAnother) {
  const Compound compound = table();
  const auto engine = GetParam().make(std::vector{compound.mesh});
  engine->add(floor_plane(kFloor), {});
  const double z = compound.frame.position.z();
  engine->add(body_of(kBody, compound), at(0, 0, z));
  engine->add(body_of(kOther, compound), at(0.005, 0, 0.1 + z));
  test::run(*engine, GetParam().steps(1.0), dt);
  expect_at_rest(*engine, kBody, at(0, 0, z));
  expect_at_rest(*engine, kOther, at(0.005, 0, 0.1 + z));
}

TEST_P(CompoundBody, ATrayCarriesABallBetweenItsWalls) {
  const Compound compound = tray();
  const auto engine = GetParam().make(std::vector{compound.mesh});
  Body smooth = floor_plane(kFloor);
  smooth.material = kSmooth;
  engine->add(smooth, {});
  BodyState start = at(0, 0, compound.frame.position.z());
  engine->add(body_of(kBody, compound), start);
  Body ball = cube(kOther);
  ball.shape = {.kind = ShapeKind::sphere, .radius = 0.02};
  engine->add(ball, at(0, 0, 0.03));
  engine->set_velocity(kBody, Vec3(0.5, 0.3, 0), Vec3(0, 0, 1));
  for (int i = 0; i < GetParam().steps(1.0); ++i) {
    engine->step(dt);
    const BodyState held = engine->state(kBody);
    const Vec3 inside = held.orientation.conjugate() * (engine->state(kOther).position - held.position);
    ASSERT_LT(inside.head<2>().cwiseAbs().maxCoeff(), 0.08 - 0.02 + 1e-3) << "at " << i * dt << " s";
    ASSERT_NEAR(engine->state(kOther).position.z(), 0.03, 1e-3);
  }
  EXPECT_GT(engine->state(kOther).position.x(), 0.2) << "it was taken along";
}

TEST_P(CompoundBody, APartHasItsOwnMaterial) {
  for (const Material& material : {kSmooth, kRough}) {
    const Compound compound = assemble(std::vector{part({0.05, 0.05, 0.02}, {0, 0, 0}, 0.2, material),
                                                   part({0.02, 0.02, 0.02}, {0, 0, 0.04}, 0.01)}, {});
    const auto engine = GetParam().make(std::vector{compound.mesh});
    Body floor = floor_plane(kFloor);
    floor.material = kRough;
    engine->add(floor, {});
    engine->add(body_of(kBody, compound), at(0, 0, 0.02 + compound.frame.position.z()));
    engine->set_velocity(kBody, Vec3(1, 0, 0), Vec3::Zero());
    test::run(*engine, GetParam().steps(0.1), dt);
    EXPECT_NEAR(engine->state(kBody).linear_velocity.x(), 1.0 - material.friction * test::kG * 0.1, 0.02);
  }
}

std::vector<test::Tested> engines_with_parts() {
  std::vector<test::Tested> all = test::tested_engines({0.001}, {0.001, 0.004});
  std::erase_if(all, [](const test::Tested& one) {
    return one.engine != "bullet" && one.engine != "bullet_float" && one.engine != "ode";
  });
  return all;
}
INSTANTIATE_TEST_SUITE_P(Engines, CompoundBody, testing::ValuesIn(engines_with_parts()), test::name_of);

TEST(CompoundBodies, AreRefusedByTheOtherEnginesWithThoseThatHoldThem) {
  const Compound compound = table();
  for (const std::string& name : engine_names()) {
    if (name.starts_with("bullet") || name == "ode") continue;
    const auto engine = test::Tested{name, "fast"}.make(std::vector{compound.mesh});
    try {
      engine->add(body_of(kBody, compound), at(0, 0, 1));
      ADD_FAILURE() << name;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("use bullet, bullet_float or ode"), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace subworld
