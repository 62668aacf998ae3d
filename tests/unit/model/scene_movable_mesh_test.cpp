// Concave meshes that move: their convex parts, mass properties, the cache, and what is refused.
#include "model/error.hpp"
#include "model/scene/scene.hpp"
#include "model/shapes/mass_properties.hpp"
#include "support/channel_mesh.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace subworld {
namespace {

std::string read_all(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class MovableMesh : public ::testing::Test {
 protected:
  void SetUp() override {
    setenv("XDG_CACHE_HOME", (folder_.path() + "/caches").c_str(), 1);
    folder_.write("u.obj", test::kChannel);
  }
  void TearDown() override { unsetenv("XDG_CACHE_HOME"); }

  [[nodiscard]] Scene load(const std::string& rest, const std::string& file = "u.obj") const {
    return load_scene(
        folder_.write("scene.yaml", "name: one\nbodies:\n  - {name: u, shape: mesh, file: " + file + ", " + rest +
                                        "}\nusers:\n  - {name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: "
                                        "0.1, position_m: [0, 0, 5]}}\n"));
  }
  void expect_error(const std::string& rest, const std::string& text, const std::string& file = "u.obj") const {
    try {
      (void)load(rest, file);
      ADD_FAILURE() << "no error; expected: " << text;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(text), std::string::npos) << e.what();
      EXPECT_NE(std::string(e.what()).find("scene.yaml:3:"), std::string::npos) << e.what();
    }
  }
  [[nodiscard]] std::vector<std::filesystem::path> cached(const std::string& where) const {
    std::vector<std::filesystem::path> files;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path() + where, none))
      files.push_back(entry.path());
    return files;
  }
  TemporaryFolder folder_;
};

TEST_F(MovableMesh, AChannelIsThreeBoxesWithoutError) {
  const Scene scene = load("mass_kg: 2, position_m: [1, 0, 0]");
  const Mesh& mesh = scene.meshes[scene.bodies[0].shape.mesh];
  EXPECT_EQ(scene.bodies[0].shape.kind, ShapeKind::compound);
  ASSERT_EQ(mesh.parts.size(), 3U);
  double volume = 0.0;
  for (const BodyPart& part : mesh.parts) volume += integrate(scene.meshes[part.shape.mesh]).volume;
  EXPECT_NEAR(volume, test::kChannelVolume, 1e-6 * test::kChannelVolume);
  ASSERT_EQ(scene.divided.size(), 1U);
  EXPECT_EQ(scene.divided[0].parts, 3U);
  EXPECT_LT(scene.divided[0].error_m, 1e-8);
}

// A floor of 100 mm x 10 mm and two walls of 10 mm x 50 mm, 100 mm long: boxes of known mass properties.
TEST_F(MovableMesh, HasTheMassPropertiesOfTheMesh) {
  const Scene scene = load("density_kg_m3: 1000, position_m: [1, 2, 3]");
  const Body& body = scene.bodies[0];
  EXPECT_NEAR(body.mass, 0.2, 1e-7);
  const double centre = (0.1 * 0.005 + 2 * 0.05 * 0.035) / 0.2;  // each mass times height
  EXPECT_LT((scene.initial[0].position - Vec3(1, 2 + centre, 3.05)).norm(), 1e-7);
  const auto box = [](double mass, double a, double b) { return mass * (a * a + b * b) / 12; };
  const double down = centre - 0.005, up = 0.035 - centre;
  const double x = box(0.1, 0.01, 0.1) + 0.1 * down * down + 2 * (box(0.05, 0.05, 0.1) + 0.05 * up * up);
  const double y = box(0.1, 0.1, 0.1) + 2 * (box(0.05, 0.01, 0.1) + 0.05 * 0.045 * 0.045);
  const double z =
      box(0.1, 0.1, 0.01) + 0.1 * down * down + 2 * (box(0.05, 0.01, 0.05) + 0.05 * (0.045 * 0.045 + up * up));
  EXPECT_LT((body.inertia - Vec3(x, y, z)).norm(), 1e-6 * x) << body.inertia.transpose();
  const Scene given = load("mass_kg: 3, centre_of_mass_m: [0, 0.02, 0.05], inertia_kg_m2: [1, 2, 2.5, 0, 0, 0]");
  EXPECT_NEAR(given.initial[0].position.y(), 0.02, 1e-12);
  EXPECT_LT((given.bodies[0].inertia - Vec3(1, 2, 2.5)).norm(), 1e-12);
}

TEST_F(MovableMesh, AFileThatFacesInwardsHasTheSameMass) {
  std::string inwards;
  std::istringstream lines(test::kChannel);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string kind, a, b, c;
    words >> kind >> a >> b >> c;
    inwards += kind == "f" ? "f " + a + " " + c + " " + b + "\n" : line + "\n";
  }
  folder_.write("in.obj", inwards);
  EXPECT_NEAR(load("density_kg_m3: 1000", "in.obj").bodies[0].mass, 0.2, 1e-7);
}

TEST_F(MovableMesh, ACupIsHollowWithinItsConcavity) {
  folder_.write("cup.obj", test::cup(48));
  const Scene scene = load("mass_kg: 1, decompose: {concavity_m: 0.002, most_parts: 100}", "cup.obj");
  ASSERT_EQ(scene.divided.size(), 1U);
  EXPECT_LE(scene.divided[0].error_m, 0.002);
  EXPECT_LE(scene.divided[0].parts, 40U);
  const Mesh& mesh = scene.meshes[scene.bodies[0].shape.mesh];
  for (const BodyPart& part : mesh.parts) {
    for (const Vec3& v : scene.meshes[part.shape.mesh].vertices) {
      const Vec3 at =
          scene.initial[0].position + scene.initial[0].orientation * (part.pose.position + part.pose.orientation * v);
      EXPECT_TRUE(std::hypot(at.x(), at.y()) > 0.034 - 1e-6 || at.z() < 0.006 + 1e-6) << at.transpose();
    }
  }
  EXPECT_EQ(load("mass_kg: 1, decompose: {most_parts: 1}", "cup.obj").divided[0].parts, 1U);
}

TEST_F(MovableMesh, IsDividedOnce) {
  const Scene first = load("mass_kg: 1");
  const auto files = cached("/.subworld");
  ASSERT_EQ(files.size(), 1U);
  EXPECT_EQ(first.divided[0].cache, files[0]);
  // A file that is made again has the time of now.
  const auto before = std::filesystem::last_write_time(files[0]) - std::chrono::hours(1);
  std::filesystem::last_write_time(files[0], before);
  const std::string text = read_all(files[0]);
  const Scene second = load("mass_kg: 1");
  const Mesh &a = first.meshes[first.bodies[0].shape.mesh], &b = second.meshes[second.bodies[0].shape.mesh];
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(first.bodies[0].inertia, second.bodies[0].inertia);
  EXPECT_EQ(first.divided[0].error_m, second.divided[0].error_m);
  EXPECT_EQ(cached("/.subworld").size(), 1U);
  EXPECT_EQ(std::filesystem::last_write_time(files[0]), before);
  EXPECT_EQ(load("mass_kg: 1, repeat: {row: {count: 3, step_m: [1, 0, 0]}}").divided.size(), 1U);
  // One that is cut off is made again.
  std::ofstream(files[0]) << text.substr(0, text.size() / 2);
  EXPECT_EQ(load("mass_kg: 1").divided[0].parts, 3U);
  EXPECT_EQ(read_all(files[0]), text);
  (void)load("mass_kg: 1, decompose: {concavity_m: 0.01}");
  EXPECT_EQ(cached("/.subworld").size(), 2U) << "other settings are another file";
}

TEST_F(MovableMesh, ThatCannotBeKeptBesideTheSceneIsKeptElsewhereOrNot) {
  folder_.write(".subworld", "a file in place of the folder");
  EXPECT_EQ(load("mass_kg: 1").divided[0].parts, 3U);
  EXPECT_EQ(cached("/caches/subworld").size(), 1U);
  std::filesystem::remove(folder_.path() + "/.subworld");
  std::filesystem::create_directories(std::filesystem::path(folder_.path()) / ".subworld" /
                                      cached("/caches/subworld").front().filename());  // a folder in place of the file
  EXPECT_EQ(load("mass_kg: 1").divided[0].cache, cached("/caches/subworld").front());
  std::filesystem::remove_all(folder_.path() + "/.subworld");
  folder_.write(".subworld", "a file in place of the folder");
  setenv("XDG_CACHE_HOME", (folder_.path() + "/.subworld").c_str(), 1);
  const Scene scene = load("mass_kg: 1");
  EXPECT_EQ(scene.divided[0].parts, 3U);
  EXPECT_EQ(scene.divided[0].cache, "");
}

TEST_F(MovableMesh, RefusalsNameTheCure) {
  const std::string channel = test::kChannel;
  folder_.write("open.obj", channel.substr(0, channel.find_last_of('f')));
  expect_error("mass_kg: 1", "is not closed", "open.obj");
  expect_error("mass_kg: 1", "fill holes", "open.obj");
  folder_.write("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n");
  expect_error("mass_kg: 1", "encloses no volume", "sheet.obj");
  folder_.write("line.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2\n");
  expect_error("mass_kg: 1", "has no triangles", "line.obj");
  expect_error("mass_kg: 1", "no such mesh file", "none.obj");
  folder_.write("empty.obj", "");
  expect_error("mass_kg: 1", "\"empty.obj\" is empty; export the mesh again", "empty.obj");
  folder_.write("short.obj", "v 0 0 0\n");
  expect_error("mass_kg: 1", "too small; is the file complete? Export it again, as STL or OBJ", "short.obj");
  expect_error("fixed: true, decompose: {most_parts: 3}", "a fixed mesh has its triangles as they are");
  expect_error("mass_kg: 1, decompose: {most_parts: 0}", "decompose.most_parts");
  expect_error("mass_kg: 1, decompose: {concavity_m: 0}", "decompose.concavity_m");
  expect_error("mass_kg: 1, decompose: {parts: 3}", "most_parts");
  expect_error("decompose: {most_parts: 3}", "mass_kg");
}

}  // namespace
}  // namespace subworld
