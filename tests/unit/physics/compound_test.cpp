// Bodies of several parts rest, hold others inside and slide as their parts say, in the engines that have them.
#include "model/shapes/compound.hpp"
#include "model/error.hpp"
#include "model/scene/scene.hpp"
#include "model/shapes/mass_properties.hpp"
#include "support/channel_mesh.hpp"
#include "support/engines.hpp"
#include "support/grid.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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

// The cup of a mesh file slides, and takes along the ball in it.
TEST_P(CompoundBody, AConcaveMeshThatMovesHoldsABall) {
  const TemporaryFolder folder;
  folder.write("cup.obj", test::cup(24));
  const Scene scene = load_scene(folder.write("scene.yaml", R"(
name: cup
bodies:
  - {name: cup, shape: mesh, file: cup.obj, mass_kg: 0.5}
users:
  - {name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, position_m: [0, 0, 5]}}
)"));
  const auto engine = GetParam().make(scene.meshes);
  Body smooth = floor_plane(kFloor);
  smooth.material = kSmooth;
  engine->add(smooth, {});
  Body cup = scene.bodies[0];
  cup.id = kBody;
  engine->add(cup, scene.initial[0]);
  Body ball = cube(kOther);
  ball.shape = {.kind = ShapeKind::sphere, .radius = 0.015};
  ball.mass = 0.05;
  engine->add(ball, at(0, 0, 0.004 + 0.015));
  engine->set_velocity(kBody, Vec3(0.3, 0.1, 0), Vec3::Zero());
  const double error_m = scene.divided[0].error_m;
  for (int i = 0; i < GetParam().steps(1.0); ++i) {
    engine->step(dt);
    const BodyState held = engine->state(kBody);
    const Vec3 inside = held.orientation.conjugate() * (engine->state(kOther).position - held.position);
    ASSERT_LT(inside.head<2>().norm(), 0.036 - 0.015 + 1e-3) << "at " << i * dt << " s";
    ASSERT_NEAR(engine->state(kOther).position.z(), 0.019, error_m + 1e-3);
  }
  EXPECT_GT(engine->state(kOther).position.x(), 0.15) << "it was taken along";
}

TEST_P(CompoundBody, APartHasItsOwnMaterial) {
  for (const Material& material : {kSmooth, kRough}) {
    const Compound compound = assemble(
        std::vector{part({0.05, 0.05, 0.02}, {0, 0, 0}, 0.2, material), part({0.02, 0.02, 0.02}, {0, 0, 0.04}, 0.01)},
        {});
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

/// ODE sees no more than the present.
class FastCompoundBody : public CompoundBody {};
TEST_P(FastCompoundBody, DoesNotPassAThinPlate) {
  const Compound compound = table();
  const auto engine = GetParam().make(std::vector{compound.mesh});
  Body plate = cube(kFloor);
  plate.mass = 0.0;
  plate.shape.half_extents = {0.5, 0.5, 0.0025};
  engine->add(plate, {});
  engine->add(body_of(kBody, compound), at(0, 0, 0.3));
  engine->set_velocity(kBody, Vec3(0, 0, -30), Vec3(2, 1, 0));
  test::run(*engine, GetParam().steps(0.2), dt);
  EXPECT_GT(engine->state(kBody).position.z(), 0.0);
}

// The sides of the tiles are inside the floor: they do not stop what slides over their seams without friction.
TEST_P(FastCompoundBody, FlushPartsAreOneFloor) {
  std::vector<WeightedPart> tiles;
  for (int i = 0; i < 7; ++i) tiles.push_back(part({0.05, 0.2, 0.02}, {0.1 * i, 0, -0.02}, 1.0, kSmooth));
  const Compound floor = assemble(tiles, {});
  for (const Shape& shape :
       {cube(kOther).shape, Shape{.kind = ShapeKind::cylinder, .radius = 0.05, .half_length = 0.05},
        Shape{.kind = ShapeKind::sphere, .radius = 0.05}}) {
    const auto engine = GetParam().make(std::vector{floor.mesh});
    Body fixed = body_of(kFloor, floor);
    fixed.mass = 0.0;
    BodyState ground;
    ground.position = floor.frame.position;
    ground.orientation = floor.frame.orientation;
    engine->add(fixed, ground);
    Body slider = cube(kOther);
    slider.shape = shape;
    slider.inertia = principal_inertia(shape, slider.mass);
    slider.material = kSmooth;
    engine->add(slider, at(0, 0, 0.05));
    engine->set_velocity(kOther, Vec3(1, 0, 0), Vec3::Zero());
    for (int i = 0; i < GetParam().steps(0.5); ++i) {
      engine->step(dt);
      ASSERT_NEAR(engine->state(kOther).position.z(), 0.05, 1e-3) << "at " << i * dt << " s";
    }
    const double kept = shape.kind == ShapeKind::sphere ? 3e-3 : 1e-3;
    EXPECT_NEAR(engine->state(kOther).linear_velocity.x(), 1.0, kept);
  }
}

/// A tube along z, and the side of which it consists.
struct Tube {
  Mesh side;
  std::vector<WeightedPart> parts;
};
Tube tube(double inner, double wall, double deep) {
  constexpr int kSides = 24;
  const double slope = std::tan(M_PI / kSides);
  Tube made;
  for (const double x : {inner, inner + wall})
    for (const double y : {-slope * x, slope * x})
      for (const double z : {-0.5 * deep, 0.5 * deep}) made.side.vertices.emplace_back(x, y, z);
  made.side = convex_hull(made.side);
  const PrincipalFrame frame = move_to_principal_frame(made.side);
  for (int i = 0; i < kSides; ++i) {
    const Pose turn{.orientation = Quat(Eigen::AngleAxisd(2.0 * M_PI * i / kSides, Vec3::UnitZ()))};
    made.parts.push_back({{{.kind = ShapeKind::convex, .mesh = 0}, turn * frame.frame, kSmooth}, 1.0, frame.inertia});
  }
  return made;
}

// A peg of 20 mm, and 0.1 to 0.5 mm of play around it.
TEST_P(CompoundBody, ARoundPegFallsThroughItsHole) {
  constexpr double kRadius_m = 0.01, kDeep_m = 0.04;
  for (const double play_m : {0.0001, 0.0002, 0.0005}) {
    SCOPED_TRACE(play_m);
    const Tube made = tube(kRadius_m + play_m, 0.01, kDeep_m);
    const Compound whole = assemble(made.parts, std::vector{made.side});
    const auto engine = GetParam().make(std::vector{made.side, whole.mesh});
    Body hole = body_of(kFloor, whole, 1);
    hole.mass = 0.0;
    engine->add(hole, {});
    Body peg = cube(kBody);
    peg.shape = {.kind = ShapeKind::cylinder, .radius = kRadius_m, .half_length = 0.025};
    peg.inertia = principal_inertia(peg.shape, peg.mass);
    engine->add(peg, at(0.5 * play_m, 0, 0.5 * kDeep_m + 0.026));
    test::run(*engine, GetParam().steps(0.1), dt);
    EXPECT_NEAR(engine->state(kBody).position.z(), 0.046 - 0.5 * test::kG * 0.01, 1e-3) << "it falls freely";
  }
}

// A physical pendulum of small amplitude: T = 2 pi sqrt((I + m l^2) / (m g l)), l from the pin to the centre of mass.
TEST_P(CompoundBody, APinInTubesIsAHinge) {
  constexpr double kPin_m = 0.005, kPlay_m = 0.0002, kAmplitude_rad = 0.1;
  const Tube made = tube(kPin_m + kPlay_m, 0.005, 0.02);
  const Quat across(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitX()));
  std::vector<WeightedPart> knuckles;
  for (const double y : {-0.05, 0.05}) {
    for (WeightedPart one : made.parts) {
      one.part.pose = Pose{Vec3(0, y, 0), across} * one.part.pose;
      knuckles.push_back(one);
    }
  }
  const Compound frame = assemble(knuckles, std::vector{made.side});
  const Shape pin{.kind = ShapeKind::cylinder, .radius = kPin_m, .half_length = 0.07};
  const Compound lid =
      assemble(std::vector{WeightedPart{{pin, {.orientation = across}, kSmooth}, 0.1, principal_inertia(pin, 0.1)},
                           part({0.01, 0.02, 0.1}, {0, 0, -0.1}, 0.4, kSmooth)},
               {});
  const auto engine = GetParam().make(std::vector{made.side, frame.mesh, lid.mesh});
  Body fixed = body_of(kFloor, frame, 1);
  fixed.mass = 0.0;
  engine->add(fixed, {});
  const Quat tilt(Eigen::AngleAxisd(kAmplitude_rad, Vec3::UnitY()));
  BodyState start;
  start.orientation = tilt * lid.frame.orientation;
  start.position = Vec3(0, 0, -kPlay_m) + tilt * lid.frame.position;
  engine->add(body_of(kBody, lid, 2), start);
  const double arm = lid.frame.position.norm();
  const Eigen::Matrix3d turn = lid.frame.orientation.toRotationMatrix();
  const double about_y = (turn * lid.inertia.asDiagonal() * turn.transpose())(1, 1);
  const double period = 2 * M_PI * std::sqrt((about_y + lid.mass * arm * arm) / (lid.mass * test::kG * arm));
  std::vector<double> crossings;
  double before = start.position.x();
  for (int i = 1; i <= GetParam().steps(3.0); ++i) {
    engine->step(dt);
    const BodyState now = engine->state(kBody);
    if (now.position.x() * before < 0.0) crossings.push_back(i * dt);
    before = now.position.x();
    const Vec3 hinge = now.position - now.orientation * lid.frame.orientation.conjugate() * lid.frame.position;
    ASSERT_LT(hinge.norm(), 3 * kPlay_m) << "at " << i * dt << " s";
  }
  ASSERT_GE(crossings.size(), 4U);
  const double measured = 2.0 * (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
  EXPECT_NEAR(measured / period, 1.0, 0.01);
}

std::vector<test::Tested> engines_of(std::initializer_list<std::string_view> names) {
  return test::only(names, test::tested_engines({0.001}, {0.001, 0.004}));
}
test::Halves<test::Tested> with_compounds() { return test::halves(engines_of({"bullet", "bullet_float", "ode"}), 3); }
INSTANTIATE_TEST_SUITE_P(Engines, CompoundBody, testing::ValuesIn(with_compounds().half), test::name_of);
INSTANTIATE_TEST_SUITE_P(Full, CompoundBody, testing::ValuesIn(with_compounds().other), test::name_of);
INSTANTIATE_TEST_SUITE_P(Engines, FastCompoundBody, testing::ValuesIn(engines_of({"bullet", "bullet_float"})),
                         test::name_of);

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
