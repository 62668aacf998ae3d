// Mass properties of bodies of several parts, and what is wrong with their descriptions.
#include "model/error.hpp"
#include "model/scene/scene.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

namespace subworld {
namespace {

class SceneCompound : public ::testing::Test {
 protected:
  /// A scene with one body.
  [[nodiscard]] Scene load(const std::string& body) const {
    return load_scene(
        folder_.write("scene.yaml",
                      "name: one\nmaterials: {ice: {friction: 0.02}}\nbodies:\n"
                      "  - {name: floor, shape: plane, fixed: true}\n  - " +
                          body +
                          "\nusers:\n  - {name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, "
                          "position_m: [0, 0, 5]}}\n"));
  }
  void expect_error(const std::string& body, const std::string& text) const {
    try {
      (void)load(body);
      ADD_FAILURE() << "no error; expected: " << text;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(text), std::string::npos) << e.what();
    }
  }
  TemporaryFolder folder_;
};

// Two rods of 1 kg, 0.2 m along x and 0.1 m along y, meet in a corner. Centre, moments and their axes by hand.
TEST_F(SceneCompound, OfTwoBoxesHasTheMassPropertiesOfTheWhole) {
  const Scene scene = load(
      "{name: l, shape: compound, position_m: [1, 2, 3], parts: ["
      "{shape: box, size_m: [0.2, 0.02, 0.02], mass_kg: 1, position_m: [0.1, 0, 0]}, "
      "{shape: box, size_m: [0.02, 0.2, 0.02], mass_kg: 1, position_m: [0, 0.1, 0], material: ice}]}");
  const Body& body = scene.bodies[1];
  EXPECT_DOUBLE_EQ(body.mass, 2.0);
  EXPECT_LT((scene.initial[1].position - Vec3(1.05, 2.05, 3)).norm(), 1e-12);
  const double along = (0.02 * 0.02 + 0.02 * 0.02) / 12, across = (0.2 * 0.2 + 0.02 * 0.02) / 12;
  const double straight = along + across + 2 * 0.05 * 0.05, product = 2 * 0.05 * 0.05;
  const Vec3 expected(straight - product, straight + product, 2 * across + 4 * 0.05 * 0.05);
  EXPECT_LT((body.inertia - expected).norm(), 1e-12) << body.inertia.transpose();
  const Mesh& mesh = scene.meshes[body.shape.mesh];
  ASSERT_EQ(mesh.parts.size(), 2U);
  EXPECT_EQ(mesh.parts[1].material.friction, 0.02);
  const Box box = bounds(body.shape, scene.initial[1], scene.meshes);
  EXPECT_LT((box.lower - Vec3(0.99, 1.99, 2.99)).norm(), 1e-9) << box.lower.transpose();
  EXPECT_LT((box.upper - Vec3(1.2, 2.2, 3.01)).norm(), 1e-9) << box.upper.transpose();
  EXPECT_NEAR(thickness(body.shape, scene.meshes), 0.02, 1e-12);
}

TEST_F(SceneCompound, AMassOfTheWholeIsSharedByVolume) {
  const Scene scene = load(
      "{name: hammer, shape: compound, density_kg_m3: 1000, parts: ["
      "{shape: cylinder, radius_m: 0.01, length_m: 0.3}, "
      "{shape: capsule, radius_m: 0.03, length_m: 0.06, position_m: [0, 0, 0.15], "
      "rotation: {axis: [0, 1, 0], angle_deg: 90}}]}");
  const double handle = 1000 * M_PI * 1e-4 * 0.3, head = 1000 * M_PI * 9e-4 * (0.06 + 0.04);
  EXPECT_NEAR(scene.bodies[1].mass, handle + head, 1e-9);
  EXPECT_NEAR(scene.initial[1].position.z(), head * 0.15 / (handle + head), 1e-12);
}

TEST_F(SceneCompound, OneMadeOfTheHalvesOfABoxIsTheBox) {
  const Scene scene = load(
      "{name: box, shape: compound, mass_kg: 3, parts: ["
      "{shape: box, size_m: [0.1, 0.3, 0.4], position_m: [-0.05, 0, 0]}, "
      "{shape: box, size_m: [0.1, 0.3, 0.4], position_m: [0.05, 0, 0]}]}");
  const Shape whole{.kind = ShapeKind::box, .half_extents = Vec3(0.1, 0.15, 0.2)};
  EXPECT_LT((scene.bodies[1].inertia - principal_inertia(whole, 3.0)).norm(), 1e-12);
  EXPECT_TRUE(scene.initial[1].position.isZero(1e-12));
}

// The inner sides touch the circle of the radius from outside: what has that radius fits.
TEST_F(SceneCompound, ATubeIsARingOfSides) {
  const Scene scene = load(
      "{name: nut, shape: compound, density_kg_m3: 1000, parts: ["
      "{shape: tube, radius_m: 0.01, wall_m: 0.005, length_m: 0.02, sides: 6}]}");
  const double area = 6 * std::tan(M_PI / 6) * (0.015 * 0.015 - 0.01 * 0.01);
  EXPECT_NEAR(scene.bodies[1].mass, 1000 * area * 0.02, 1e-9);
  EXPECT_EQ(scene.meshes[scene.bodies[1].shape.mesh].parts.size(), 6U);
  EXPECT_NEAR(scene.bodies[1].inertia.x(), scene.bodies[1].inertia.y(), 1e-12) << "six equal sides";
  const Scene given = load(
      "{name: nut, shape: compound, parts: "
      "[{shape: tube, radius_m: 0.01, wall_m: 0.005, length_m: 0.02, mass_kg: 3}]}");
  EXPECT_NEAR(given.bodies[1].mass, 3.0, 1e-12);
}

// A frustum of a hole, with the volume (A + B + sqrt(A B)) l / 3, in a prism.
TEST_F(SceneCompound, ATubeMayWidenToItsTop) {
  const Scene scene = load(
      "{name: seat, shape: compound, density_kg_m3: 1000, parts: ["
      "{shape: tube, radius_m: 0.01, top_radius_m: 0.02, wall_m: 0.005, length_m: 0.02, sides: 6}]}");
  const double per_square = 6 * std::tan(M_PI / 6);
  const double hole = per_square * (0.01 * 0.01 + 0.02 * 0.02 + 0.01 * 0.02) * 0.02 / 3;
  EXPECT_NEAR(scene.bodies[1].mass, 1000 * (per_square * 0.025 * 0.025 * 0.02 - hole), 1e-9);
  EXPECT_LT(scene.initial[1].position.z(), 0.0) << "the material is below";
}

TEST_F(SceneCompound, ErrorsNameThePlaceAndTheCure) {
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: []}", "a compound body needs a part");
  expect_error("{name: a, shape: compound, mass_kg: 1}", "\"parts\"");
  expect_error("{name: a, shape: box, size_m: [1, 1, 1], mass_kg: 1, parts: []}", "a box has no such measure");
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: [{shape: box, size_m: [1, 1, 1], mass_kg: 1}]}",
               "the body has it, or is fixed");
  expect_error("{name: a, shape: compound, parts: [{shape: box, size_m: [1, 1, 1]}]}", "mass_kg");
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: [{shape: plane}]}", "a plane is no part");
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: [{shape: compound}]}", "a part has no parts");
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: [{shape: box, size_m: [1, 1, 1], name: b}]}",
               "parts[0].name");
  expect_error("{name: a, shape: tube, radius_m: 1, wall_m: 1, length_m: 1, mass_kg: 1}", "a tube is a part");
  expect_error("{name: a, shape: compound, mass_kg: 1, parts: [{shape: mesh, file: a.obj}]}", "a mesh is no part");
  expect_error(
      "{name: a, shape: compound, mass_kg: 1, parts: "
      "[{shape: tube, radius_m: 0.1, wall_m: 1.0e-6, length_m: 0.1}]}",
      "wall_m");
  expect_error(
      "{name: a, shape: compound, mass_kg: 1, parts: "
      "[{shape: tube, radius_m: 0.1, top_radius_m: 0, wall_m: 0.01, length_m: 0.1}]}",
      "top_radius_m");
}

TEST_F(SceneCompound, AnErrorInAPartIsTheOnlyOne) {
  try {
    (void)load("{name: a, shape: compound, parts: [{shape: box, sise_m: [1, 1, 1], mass_kg: 1}]}");
    ADD_FAILURE();
  } catch (const Error& e) {
    EXPECT_EQ(std::string(e.what()).find("density_kg_m3"), std::string::npos) << e.what();
  }
}

TEST_F(SceneCompound, CopiesInAHeapLieAboveTheGround) {
  const Scene scene = load(
      "{name: c, shape: compound, repeat: {heap: {count: 10, area_m: [1, 1], seed: 1}}, parts: "
      "[{shape: box, size_m: [0.1, 0.1, 0.1], position_m: [0, 0, 0.2], mass_kg: 1}]}");
  for (std::size_t b = 1; b <= 10; ++b)
    EXPECT_GE(bounds(scene.bodies[b].shape, scene.initial[b], scene.meshes).lower.z(), 0.0) << b;
}

TEST_F(SceneCompound, OfThePageLoads) {
  std::ifstream file(std::string(SCENES_FOLDER) + "/README.md");
  const std::string page((std::istreambuf_iterator<char>(file)), {});
  const std::string open = "```yaml\n";
  const std::size_t begin = page.find(open, page.find("### Bodies of several parts")) + open.size();
  const Scene scene = load_scene(folder_.write("table.yaml", page.substr(begin, page.find("```", begin) - begin)));
  EXPECT_DOUBLE_EQ(scene.bodies[1].mass, 0.7);
}

TEST(SurfaceOfAShape, IsClosedAndHasItsVolume) {
  for (const Shape& shape : {Shape{.kind = ShapeKind::sphere, .radius = 0.1},
                             Shape{.kind = ShapeKind::box, .half_extents = Vec3(0.1, 0.2, 0.3)},
                             Shape{.kind = ShapeKind::capsule, .radius = 0.1, .half_length = 0.2},
                             Shape{.kind = ShapeKind::cylinder, .radius = 0.1, .half_length = 0.2}}) {
    const Mesh mesh = surface(shape, {});
    EXPECT_NEAR(integrate(mesh).volume / volume(shape), 1.0, 0.05) << static_cast<int>(shape.kind);
  }
}

TEST_F(SceneCompound, GivenMassPropertiesTakeThePlaceOfThoseOfTheParts) {
  const std::string part = ", shape: compound, parts: [{shape: box, size_m: [0.2, 0.1, 0.1]}]";
  const Scene scene = load(
      "{name: link, position_m: [1, 0, 0], mass_kg: 3, centre_of_mass_m: [0.05, 0, 0], "
      "inertia_kg_m2: [0.01, 0.02, 0.025, 0, 0, 0]" +
      part + "}");
  const Body& link = scene.bodies[1];
  EXPECT_EQ(link.mass, 3.0);
  EXPECT_NEAR(link.inertia.sum(), 0.055, 1e-12);
  EXPECT_NEAR(scene.initial[1].position.x(), 1.05, 1e-12);
  EXPECT_NEAR(scene.meshes[link.shape.mesh].parts[0].pose.position.x(), -0.05, 1e-12);
  expect_error("{name: link, mass_kg: 3, inertia_kg_m2: [0.01, 0.02, -0.025, 0, 0, 0]" + part + "}",
               "is of no body: its principal moments are 0.01, 0.02 and -0.025 kg m2, and all must be positive");
  expect_error(
      "{name: link, mass_kg: 3, inertia_kg_m2: [0.01, 0.02, 0.0302, 0, 0, 0]" + part + "}",
      "bodies[1].inertia_kg_m2: is of no body: its principal moments are 0.01, 0.02 and 0.0302 kg m2, and none "
      "may exceed the sum of the others; check the values, in the order xx, yy, zz, xy, xz, yz");
  expect_error("{name: link, mass_kg: 3, inertia_kg_m2: [2, 2, 1, 1.9, 0, 0]" + part + "}", "3.9");   // turned axes
  (void)load("{name: link, mass_kg: 3, inertia_kg_m2: [0.333, 0.333, 0.667, 0, 0, 0]" + part + "}");  // a thin plate
  expect_error("{name: link, density_kg_m3: 3, inertia_kg_m2: [0.01, 0.02, 0.025, 0, 0, 0]" + part + "}",
               "needs the mass of the whole; add mass_kg");
  expect_error("{name: link, mass_kg: 3, centre_of_mass_m: [0, 0, 0]" + part + "}", "add inertia_kg_m2");
  expect_error("{name: link, mass_kg: 3, inertia_kg_m2: [1, 1, 1, 0, 0, 0], shape: sphere, radius_m: 1}",
               "write shape: compound with one part");
}

}  // namespace
}  // namespace subworld
