// Warnings of `plan` and `run` for scenes beyond the limits of an engine or a device.
#include "plan/limits.hpp"

#include "model/error.hpp"
#include "physics/plugin.hpp"
#include "run/run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

namespace subworld {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A floor and two cubes of 10 cm, 20 cm apart, in an engine with low limits; the world's step is 4 ms.
class Limits : public ::testing::Test {
 protected:
  Limits() {
    setenv("SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER ":" ENGINES_FOLDER, 1);
    scene.settings.world.name = "narrow";
    add(named("floor", ShapeKind::plane, 0.0), Vec3::Zero());
    add(named("first", ShapeKind::box, 1.0), {0, 0, 0.05});
    add(named("second", ShapeKind::box, 1.0), {0.2, 0, 0.05});
  }

  static Body named(const char* name, ShapeKind kind, double mass) {
    Body body;
    body.name = name;
    body.shape.kind = kind;
    body.shape.half_extents = Vec3::Constant(0.05);
    body.mass = mass;
    body.inertia = Vec3::Constant(mass);
    return body;
  }
  void add(Body body, const Vec3& position) {
    body.id = BodyId{static_cast<std::uint32_t>(scene.bodies.size())};
    scene.bodies.push_back(body);
    scene.initial.push_back({.position = position});
  }
  [[nodiscard]] std::vector<std::string> warnings() const { return beyond_limits(scene); }

  Scene scene;
};

TEST_F(Limits, NothingIsSaidOfAnOrdinaryScene) { EXPECT_THAT(warnings(), IsEmpty()); }

TEST_F(Limits, AHeavyBodyOnALightOne) {
  scene.initial[2].position = {0.02, 0, 0.15};
  scene.bodies[2].mass = 9.0;
  EXPECT_THAT(warnings(), IsEmpty());
  scene.bodies[2].mass = 11.0;
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("world: second lies on first and is 11 times as heavy"),
                                            HasSubstr("narrow fast supports about 10"), HasSubstr("4 ms"))));
  std::swap(scene.bodies[1].mass, scene.bodies[2].mass);
  EXPECT_THAT(warnings(), IsEmpty()) << "a light body on a heavy one";
  std::swap(scene.bodies[1].mass, scene.bodies[2].mass);
  scene.initial[2].position.z() = 0.5;
  EXPECT_THAT(warnings(), IsEmpty()) << "above, and not on it";
  scene.initial[2].position = {0.2, 0, 0.15};
  EXPECT_THAT(warnings(), IsEmpty()) << "higher, and beside it";
  scene.settings.haptic.name = "narrow";
  scene.initial[2].position = {0.02, 0, 0.15};
  scene.bodies[2].mass = 41.0;
  EXPECT_EQ(warnings().size(), 2U) << "in haptic steps too";
}

TEST_F(Limits, OfThreeTheWorstPairIsNamed) {
  scene.initial[2].position = {0.0, 0, 0.15};
  scene.bodies[1].mass = 0.05;
  add(named("third", ShapeKind::box, 50.0), {0, 0, 0.25});
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("third lies on second and is 50 times")));
}

TEST_F(Limits, AFastBodyAndAThinOne) {
  scene.bodies[1].shape.half_extents.x() = 0.02;
  scene.initial[2].linear_velocity = {-20, 0, 0};
  EXPECT_THAT(warnings(), IsEmpty()) << "80 mm in a step of the world: less than the other and the half of its own";
  scene.initial[2].linear_velocity = {-30, 0, 0};
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("world: second moves 0.12 m"), HasSubstr("through first"),
                                            HasSubstr("0.04 m thick"))));
  scene.settings.world.name = "bullet";
  EXPECT_THAT(warnings(), IsEmpty()) << "which looks ahead";
}

TEST_F(Limits, TheThinBodyItselfIsFast) {
  scene.bodies[2].shape.half_extents.x() = 0.02;
  scene.initial[2].linear_velocity = {-40, 0, 0};
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("second moves 0.16 m"), HasSubstr("through first"))));
}

TEST_F(Limits, ABodyFasterThanTheEngineAllows) {
  scene.initial[1].linear_velocity = {0, 0, 60};
  scene.initial[2].angular_velocity = {0, 0, 200};
  EXPECT_THAT(warnings(),
              ElementsAre(HasSubstr("through second"), HasSubstr("first moves with 60 m/s, and narrow allows 50"),
                          HasSubstr("second turns with 200 rad/s, and narrow allows 100")));
}

TEST_F(Limits, ASmallBox) {
  scene.bodies[1].shape.half_extents.y() = 0.01;
  EXPECT_THAT(warnings(),
              ElementsAre(AllOf(HasSubstr("below 0.03 m"), HasSubstr("first"), HasSubstr("world.length_unit_m: 0.1"))));
  scene.settings.world.length_unit_m = 0.1;
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(Limits, ABodyBeyondTheEndOfAPlane) {
  scene.initial[2].position.y() = 5.1;
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("plane floor ends 5 m"), HasSubstr("start beyond: second"))));
  scene.initial[0].position.y() = 1.0;
  EXPECT_THAT(warnings(), IsEmpty()) << "from the plane's position";
}

TEST_F(Limits, AnOptimisationThatIsDisabledAndDecidedOtherwise) {
  scene.settings.users = 1;
  scene.users.emplace_back().coupling = {.stiffness_n_m = 10, .damping_n_s_m = 1};
  scene.settings.disabled = disabled(Optimisation::energy_bound);
  EXPECT_THAT(warnings(), IsEmpty());
  scene.settings.passivity = Passivity::off;
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("--disable energy_bound changes nothing")));
  scene.settings.disabled = kDisableAll;
  EXPECT_THAT(warnings(), IsEmpty()) << "it was not disabled by name";
}

TEST_F(Limits, IterationsThatAreNotMade) {
  scene.settings.world.iterations = 20;
  EXPECT_THAT(warnings(), IsEmpty());
  scene.settings.world.iterations = 21;
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("narrow makes at most 20 iterations, not 21")));
}

TEST_F(Limits, BodiesThatOverlapAtTheStart) {
  scene.initial[2].position = {0.096, 0, 0.05};
  EXPECT_THAT(warnings(), IsEmpty()) << "4 mm of 100: less than a twentieth";
  scene.initial[2].position = {0.09, 0, 0.05};
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("first"), HasSubstr("second"), HasSubstr("overlap by 0.01 m"))));
}

TEST_F(Limits, AllOverlapsAreListed) {
  scene.settings.world.name = "bullet";
  for (int i = 0; i < 12; ++i) {
    const std::string name = "pair" + std::to_string(i);
    add(named((name + "a").c_str(), ShapeKind::box, 1.0), {0.5 * i, 1.0, 0.05});
    add(named((name + "b").c_str(), ShapeKind::box, 1.0), {0.5 * i + 0.09 - 0.001 * i, 1.0, 0.05});
  }
  EXPECT_THAT(warnings(),
              ElementsAre(AllOf(HasSubstr("at the start pair11a and pair11b overlap by 0.021 m, pair10a"),
                                HasSubstr("pair2a and pair2b overlap"), HasSubstr(" and 2 more: engines"))));
}

TEST_F(Limits, ASizeInMillimetresOrAMassInGrams) {
  scene.bodies[1].shape.half_extents = Vec3::Constant(50.0);
  scene.bodies[1].mass = 0.2;
  scene.bodies[2].mass = 500.0;
  scene.settings.world.name = "bullet";
  scene.initial[1].position = {0, 1000, 50};
  EXPECT_THAT(
      warnings(),
      ElementsAre(HasSubstr("no material has the density of first (2e-07 kg/m3); were its measures meant in mm?"),
                  HasSubstr("second (5e+05 kg/m3); was its mass meant in g? Write it in kg")));
}

TEST_F(Limits, ABodyFarFromTheOrigin) {
  scene.settings.world.name = "bullet_float";
  scene.settings.haptic.name = "bullet";
  for (BodyState& state : scene.initial) state.position.x() += 10'000.0;
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("world: bullet_float rounds positions to 0.001 m"),
                                            HasSubstr("too coarse for first, second;"))));
  for (BodyState& state : scene.initial) state.position.x() -= 9'990.0;
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(Limits, AHullInMillimetres) {
  Mesh tetrahedron;
  tetrahedron.vertices = {{0, 0, 0}, {100, 0, 0}, {0, 100, 0}, {0, 0, 100}};
  tetrahedron.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  scene.meshes.push_back(tetrahedron);
  scene.bodies[1].shape = {};
  scene.bodies[1].shape.kind = ShapeKind::convex;
  scene.bodies[1].shape.mesh = 0;
  scene.bodies[1].mass = 0.2;
  scene.settings.world.name = "bullet";
  scene.initial[1].position = {0, 1000, 50};
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("no material has the density of first (1.2e-06 kg/m3); were its "
                                                "measures meant in mm?")));
}

TEST_F(Limits, ABodyAtRestThatNothingSupports) {
  scene.bodies[2].at_rest = true;
  EXPECT_THAT(warnings(), IsEmpty());
  scene.initial[2].position.z() = 0.2;
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("second is at_rest and touches nothing")));
  scene.bodies[2].gravity = false;
  EXPECT_THAT(warnings(), IsEmpty()) << "it may hang";
}

TEST_F(Limits, TheSceneNeedsNoOtherEngineThanItsOwn) {
  setenv("SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER, 1);
  scene.settings.haptic.name = "narrow";
  EXPECT_THAT(warnings(), IsEmpty()) << "bullet, which looks for overlaps, is not there";
}

TEST_F(Limits, ADampingThatIsUnstableByItself) {
  UserSpec user;
  user.name = "user";
  user.coupling.damping_n_s_m = 1e4;
  scene.users.push_back(user);
  scene.settings.users = 1;
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("user: coupling.damping_n_s_m 10000 alone")));
}

TEST_F(Limits, AStiffCouplingAndFewCycles) {
  scene.users.emplace_back().name = "anna";
  scene.users[0].coupling.stiffness_n_m = 1e6;
  scene.settings.duration_s = 0.008;
  EXPECT_THAT(warnings(),
              ElementsAre(AllOf(HasSubstr("anna: coupling.stiffness_n_m 1e+06"), HasSubstr("oscillates above")),
                          HasSubstr("only 2 times in the 0.008 s")));
}

TEST_F(Limits, UsersForWhomADomainHasRoom) {
  RunRequest request;
  const auto refusal = [&](int users) -> std::string {
    scene.settings.users = users;
    scene.users.resize(static_cast<std::size_t>(users));
    try {
      check_request(scene, request, users);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(57), "");
  EXPECT_THAT(refusal(58), AllOf(HasSubstr("--users 58: one host has room for 57 users"), HasSubstr("120 participants"),
                                 HasSubstr("take fewer users"), HasSubstr("several hosts")));
  EXPECT_NO_THROW(check_request(scene, request, 4)) << "58 users on several hosts";
  request.domain = 232;  // beyond port 65535 there are none
  EXPECT_EQ(refusal(29), "");
  EXPECT_THAT(refusal(30), HasSubstr("room for 29 users"));
}

TEST_F(Limits, JointsThatFixABodyTwice) {
  add(named("wall", ShapeKind::box, 0.0), {5, 0, 0});
  const auto join = [&](const char* name, std::uint32_t a, std::uint32_t b) {
    Joint& joint = scene.joints.emplace_back();
    joint.name = name;
    joint.a = BodyId{a};
    joint.b = BodyId{b};
  };
  join("weld", 1, 2);
  join("foot", 1, 0);
  EXPECT_THAT(warnings(), IsEmpty());
  join("again", 2, 1);
  join("back", 3, 1);
  EXPECT_THAT(warnings(),
              ElementsAre(HasSubstr("joints weld and again both fix second to first, foot and back both fix "
                                    "first to fixed bodies: one is enough")));
  scene.joints[2].break_force_n = 10.0;  // a second screw
  scene.joints[3].kind = JointKind::hinge;
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(Limits, BodiesThatAnEngineDoesNotHold) {
  scene.users.emplace_back().name = "anna";
  const auto refusal = [&]() -> std::string {
    try {
      check_request(scene, {}, scene.settings.users);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage);
      return error.what();
    }
    return "";
  };
  scene.settings.world.name = "ode";
  EXPECT_EQ(refusal(), "");
  scene.bodies[2].material.rolling_friction = 0.01;  // the first body of its shape has none
  EXPECT_THAT(refusal(), AllOf(HasSubstr("settings.world"), HasSubstr("ode does not hold the body second: it has"),
                               HasSubstr("rolling or spinning friction; use bullet or bullet_float")));
  scene.settings.haptic.name = "ode";
  scene.settings.world.name = "bullet";
  EXPECT_EQ(refusal(), "") << "it may never be in a sub-world";
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("haptic: the run will fail once this body is in a sub-world"),
                                            HasSubstr("the body second"))));
  scene.joints.emplace_back().b = BodyId{1};
  EXPECT_THAT(refusal(), AllOf(HasSubstr("settings.haptic"), HasSubstr("ode has no joints; use bullet")));
}

TEST(HeavyOnLight, IsInterpolatedInLogarithms) {
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 1e-3), 100);
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 2e-3), 50);
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 4e-3), 25);
  EXPECT_TRUE(std::isinf(heaviest_on_light({}, 4e-3)));
}

}  // namespace
}  // namespace subworld
