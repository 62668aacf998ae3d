// What `plan` and `run` say of a scene that lies beyond what an engine or a device holds.
#include "limits.hpp"

#include "physics/plugin.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace subworld {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A floor and two cubes of 10 cm, the second 20 cm beside the first, in `ode`.
class Limits : public ::testing::Test {
 protected:
  Limits() {
    scene.settings.world.name = scene.settings.haptic.name = "ode";
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
  /// Of the sub-worlds' engine too, in its shorter step.
  [[nodiscard]] std::vector<std::string> warnings() const { return beyond_limits(scene); }

  Scene scene;
};

TEST_F(Limits, NothingIsSaidOfAnOrdinaryScene) { EXPECT_THAT(warnings(), IsEmpty()); }

TEST_F(Limits, AHeavyBodyOnALightOne) {
  scene.initial[2].position = {0.02, 0, 0.15};
  scene.bodies[2].mass = 20.0;
  const double limit = 20.0;
  ASSERT_LT(heaviest_on_light({.at_1_ms = 38, .at_4_ms = 12}, 0.004), limit);
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("world: second lies on first and is 20 times as heavy"),
                                            HasSubstr("ode fast"), HasSubstr("4 ms"))));
  scene.bodies[2].mass = 1000.0;
  EXPECT_EQ(warnings().size(), 2U) << "in haptic steps too";
  std::swap(scene.bodies[1].mass, scene.bodies[2].mass);
  EXPECT_THAT(warnings(), IsEmpty()) << "a light body on a heavy one";
  std::swap(scene.bodies[1].mass, scene.bodies[2].mass);
  scene.initial[2].position.z() = 0.5;
  EXPECT_THAT(warnings(), IsEmpty()) << "above, and not on it";
}

TEST_F(Limits, AFastBodyAndAThinOne) {
  scene.bodies[1].shape.half_extents.x() = 0.005;
  scene.initial[2].linear_velocity = {-10, 0, 0};
  EXPECT_THAT(warnings(), IsEmpty()) << "40 mm in a step of the world: less than the half of the cube";
  scene.initial[2].linear_velocity = {-30, 0, 0};
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("world: second moves 0.12 m"), HasSubstr("through first"),
                                            HasSubstr("0.01 m thick"))));
}

TEST_F(Limits, AStiffCouplingAndFewCycles) {
  scene.users.emplace_back().name = "anna";
  scene.users[0].coupling.stiffness_n_m = 1e6;
  scene.settings.duration_s = 0.008;
  EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("anna: coupling.stiffness_n_m 1e+06"), HasSubstr("N/m at most")),
                                      HasSubstr("only 2 times in the 0.008 s")));
}

TEST(HeavyOnLight, IsInterpolatedInLogarithms) {
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 1e-3), 100);
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 2e-3), 50);
  EXPECT_DOUBLE_EQ(heaviest_on_light({100, 25}, 4e-3), 25);
  EXPECT_TRUE(std::isinf(heaviest_on_light({}, 4e-3)));
}

}  // namespace
}  // namespace subworld
