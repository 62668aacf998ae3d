// Joints as a scene describes them, and what is wrong with their descriptions.
#include "model/joint.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

namespace subworld {
namespace {

std::string scene_with(const std::string& joint) {
  return "name: one\nbodies:\n"
         "  - {name: post, shape: box, size_m: [0.1, 0.1, 0.1], fixed: true}\n"
         "  - {name: wall, shape: box, size_m: [0.1, 0.1, 0.1], fixed: true, position_m: [0, 3, 0]}\n"
         "  - {name: arm, shape: box, size_m: [0.4, 0.1, 0.1], mass_kg: 1, position_m: [0.5, 0, 1], "
         "rotation: {axis: [0, 0, 1], angle_deg: 90}}\n"
         "  - {name: link, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 1, position_m: [1, 0, 1], "
         "repeat: {row: {count: 3, step_m: [0.2, 0, 0]}}}\n"
         "joints:\n  - " +
         joint +
         "\nusers:\n  - {name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, position_m: [0, 0, 5]}}\n";
}

TEST(SceneJoint, IsWhereItsDescriptionSays) {
  const Scene scene = load_text(scene_with(
      "{name: pin, type: hinge, bodies: [arm, post], at_m: [0.5, 0.2, 1], axis: [0, 3, 0], "
      "turn: {limits_deg: [-90, 45], friction_n_m: 0.5, stiffness_n_m_rad: 2, rest_deg: 30, damping_n_m_s: 0.1}, "
      "break_force_n: 7}"));
  ASSERT_EQ(scene.joints.size(), 1U);
  const Joint& pin = scene.joints[0];
  EXPECT_EQ(name_of(pin.kind), "hinge");
  EXPECT_EQ(scene.body(pin.a).name, "arm");
  EXPECT_EQ(scene.body(pin.b).name, "post");
  EXPECT_LT((pin.in_a.position - Vec3(0.2, 0, 0)).norm(), 1e-12);  // the arm points along y
  EXPECT_LT((pin.in_b.position - Vec3(0.5, 0.2, 1)).norm(), 1e-12);
  const auto pose = [&](BodyId id) { return pose_of(scene.initial[index(id)]); };
  const JointPlace place = place_of(pin, pose(pin.a), pose(pin.b));
  EXPECT_LT((place.directions[5] - Vec3::UnitY()).norm(), 1e-12);
  for (const double coordinate : place.coordinates) EXPECT_NEAR(coordinate, 0.0, 1e-12);
  const JointAxis& turn = pin.axes[5];
  EXPECT_NEAR(turn.lower, -M_PI / 2, 1e-12);
  EXPECT_NEAR(turn.upper, M_PI / 4, 1e-12);
  EXPECT_EQ(turn.friction, 0.5);
  EXPECT_NEAR(spring_energy(pin, pose(pin.a), pose(pin.b)), 0.5 * 2 * std::pow(M_PI / 6, 2), 1e-12);
  EXPECT_EQ(pin.break_force_n, 7.0);
  EXPECT_FALSE(pin.collide);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(pin.axes[i].free, i == 5);
}

TEST(SceneJoint, ARangeWithoutLengthLocks) {
  const Scene scene = load_text(scene_with(
      "{name: pin, type: hinge, bodies: [arm, post], at_m: [0, 0, 0], axis: [0, 0, 1], turn: {limits_deg: [0, 0]}}"));
  EXPECT_FALSE(scene.joints[0].axes[5].free);
}

TEST(SceneJoint, TheCopiesOfABodyAreAChain) {
  const Scene scene = load_text(scene_with("{name: pin, type: ball, between: link}"));
  ASSERT_EQ(scene.joints.size(), 2U);
  EXPECT_EQ(scene.joints[1].name, "pin/1");
  EXPECT_EQ(scene.body(scene.joints[1].a).name, "link/2");
  EXPECT_LT((scene.joints[1].in_b.position - Vec3(0.1, 0, 0)).norm(), 1e-12);
}

TEST(SceneJoint, CoordinatesOfTwoTurnsAreThoseOfACardan) {
  const Scene scene =
      load_text(scene_with("{name: cardan, type: universal, bodies: [link/0, post], at_m: [1, 0, 1], axis: [1, 0, 0], "
                           "second_axis: [0, 1, 0]}"));
  const Quat turn = Quat(Eigen::AngleAxisd(0.4, Vec3::UnitX())) * Quat(Eigen::AngleAxisd(-0.3, Vec3::UnitY()));
  const JointPlace place = place_of(scene.joints[0], {Vec3(1, 0, 1), turn}, {});
  EXPECT_NEAR(place.coordinates[3], 0.4, 1e-12);
  EXPECT_NEAR(place.coordinates[4], -0.3, 1e-12);
  EXPECT_NEAR(place.coordinates[5], 0.0, 1e-12);
}

TEST(SceneJoint, CoordinatesOfThreeTurnsAreThoseOfThreeHingesAndTheirRatesFollowTheDirections) {
  const Scene scene = load_text(scene_with(
      "{name: hip, type: six, bodies: [link/0, post], at_m: [1, 0, 1], turn_x: {}, turn_y: {limits_deg: [-60, 30]}, "
      "turn_z: {}}"));
  const auto turned = [](double x, double y, double z) {
    return Quat(Eigen::AngleAxisd(x, Vec3::UnitX())) * Quat(Eigen::AngleAxisd(y, Vec3::UnitY())) *
           Quat(Eigen::AngleAxisd(z, Vec3::UnitZ()));
  };
  const Quat turn = turned(0.4, -0.9, 1.2);
  const auto place = [&](const Quat& q) { return place_of(scene.joints[0], {Vec3(1, 0, 1), q}, {}); };
  const JointPlace before = place(turn);
  const std::array angles{0.4, -0.9, 1.2};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(before.coordinates[3 + i], angles[i], 1e-12);
  const Vec3 spin(0.3, -0.5, 0.7);
  const double dt = 1e-6;
  const JointPlace after = place(Quat(Eigen::AngleAxisd(dt * spin.norm(), spin.normalized())) * turn);
  for (std::size_t i = 3; i < 6; ++i)
    EXPECT_NEAR((after.coordinates[i] - before.coordinates[i]) / dt, before.directions[i].dot(spin), 1e-5) << i;
}

struct Wrong {
  std::string joint, message;
};

TEST(SceneJoint, ErrorsNameThePlaceAndTheCure) {
  const std::string pin = "{name: pin, type: hinge, bodies: [arm, post], at_m: [0, 0, 0], axis: [0, 0, 1]";
  for (const Wrong& wrong : {
           Wrong{"{name: pin, type: henge, bodies: [arm, post]}",
                 "8:23: joints[0].type: unknown \"henge\"; choose one of fixed, hinge"},
           {"{name: pin, bodies: [arm, post]}", "8:5: joints[0]: \"type\" is missing"},
           {"{name: pin, type: hinge, bodies: [arm, post], at_m: [0, 0, 0]}", "joints[0]: \"axis\" is missing"},
           {"{name: pin, type: hinge, bodies: [arm, post], axis: [0, 0, 1]}", "joints[0]: \"at_m\" is missing"},
           {pin + ", slide: {}}", "joints[0].slide: must not stand here, the type is \"hinge\"; remove it"},
           {pin + ", turn: {friction_n: 1}}", "joints[0].turn.friction_n: unknown key; did you mean \"friction_n_m\"?"},
           {pin + ", turn: {limits_deg: [10, -10]}}", "the lower limit comes first; exchange them"},
           {pin + ", turn: {limits_deg: [10, 10]}}", "the range has no length"},
           {pin + ", turn: {speed_rad_s: 1}}", "a motor has a limit; add torque_limit_n_m"},
           {pin + ", turn: {rest_deg: 1}}", "only a spring has a rest; add stiffness_n_m_rad"},
           {pin + ", turn: {torque_limit_n_m: 1}}",
            "nothing drives this direction; add speed_rad_s or stiffness_n_m_rad"},
           {"{name: pin, type: fixed, bodies: [arm, post, link/0]}", "a joint connects two bodies; name both"},
           {"{name: pin, type: fixed, bodies: [arm, pst]}", "no body is named \"pst\"; did you mean \"post\"?"},
           {"{name: pin, type: fixed, bodies: [wall, post]}", "both bodies are fixed; a joint needs one that moves"},
           {"{name: pin, type: fixed, bodies: [arm, arm]}", "a joint connects two different bodies"},
           {"{name: pin, type: ball, between: arm}", "needs a body with \"repeat\" and at least two copies"},
           {"{name: pin, type: ball, between: link, at_m: [0, 0, 0]}", "each of these joints is halfway"},
           {"{name: pin, type: ball, bodies: [arm, post], at_m: [0, 0, 0], turns: {rest_deg: 3}}",
            "use a joint of type six"},
           {"{name: pin, type: universal, bodies: [arm, post], at_m: [0, 0, 0], axis: [0, 0, 1], second_axis: [0, 1, "
            "1]}",
            "must be perpendicular to \"axis\""},
           {"{name: pin, type: fixed, bodies: [arm, post]}\n  - {name: pin, type: fixed, bodies: [link/0, post]}",
            "there is another joint \"pin\"; rename one"},
       }) {
    const TemporaryFolder folder;
    const std::string message = refusal(folder.write("scene.yaml", scene_with(wrong.joint)), folder.path());
    EXPECT_NE(message.find(wrong.message), std::string::npos) << wrong.joint << "\n  " << message;
  }
}

}  // namespace
}  // namespace subworld
