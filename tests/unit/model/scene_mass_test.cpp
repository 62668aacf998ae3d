#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"
#include "model/trigonometry.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace subworld {
namespace {

constexpr std::array<std::array<std::uint32_t, 4>, 6> kBoxFaces{
    {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};

Mesh box_mesh(const Vec3& half_extents, const Pose& at) {
  Mesh mesh;
  for (unsigned i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1U) != 0 ? 1 : -1, (i & 2U) != 0 ? 1 : -1, (i & 4U) != 0 ? 1 : -1);
    mesh.vertices.emplace_back(at.position + at.orientation * corner.cwiseProduct(half_extents));
  }
  for (const auto& f : kBoxFaces) {
    mesh.triangles.push_back({f[0], f[1], f[2]});
    mesh.triangles.push_back({f[0], f[2], f[3]});
  }
  return mesh;
}

std::string as_obj(const Mesh& mesh) {
  std::string text;
  for (const Vec3& v : mesh.vertices) text += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
  for (const auto& t : mesh.triangles) text += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return text;
}

Shape shape_of(ShapeKind kind, double radius, double half_length) {
  Shape shape;
  shape.kind = kind;
  shape.radius = radius;
  shape.half_length = half_length;
  return shape;
}

/// Mass and moments of a body of revolution about z, by slices: `profile` is the radius at height z.
struct Sliced {
  double volume = 0.0;
  double along = 0.0;
  double across = 0.0;
};
template <typename Profile>
Sliced slices(double half_height, Profile profile) {
  constexpr int kCount = 200'000;
  Sliced sum;
  const double dz = 2.0 * half_height / kCount;
  for (int i = 0; i < kCount; ++i) {
    const double z = -half_height + (i + 0.5) * dz;
    const double r2 = profile(z) * profile(z);
    const double part = M_PI * r2 * dz;
    sum.volume += part;
    sum.along += part * 0.5 * r2;
    sum.across += part * (0.25 * r2 + z * z);
  }
  return sum;
}

void expect_solid(const Shape& shape, const Sliced& reference) {
  const double v = volume(shape);
  const Vec3 inertia = principal_inertia(shape, v);
  EXPECT_NEAR(v / reference.volume, 1.0, 1e-6);
  EXPECT_NEAR(inertia.z() / reference.along, 1.0, 1e-6);
  EXPECT_NEAR(inertia.x() / reference.across, 1.0, 1e-6);
  EXPECT_EQ(inertia.x(), inertia.y());
}

TEST(MassProperties, RoundShapesAgreeWithSlices) {
  constexpr double r = 0.3;
  constexpr double h = 0.5;
  expect_solid(shape_of(ShapeKind::sphere, r, 0.0), slices(r, [&](double z) { return std::sqrt(r * r - z * z); }));
  expect_solid(shape_of(ShapeKind::cylinder, r, h), slices(h, [&](double) { return r; }));
  expect_solid(shape_of(ShapeKind::capsule, r, h), slices(h + r, [&](double z) {
                 const double beyond = std::max(0.0, std::abs(z) - h);
                 return std::sqrt(std::max(0.0, r * r - beyond * beyond));
               }));
}

TEST(MassProperties, BoxMeshEqualsBox) {
  Shape box;
  box.kind = ShapeKind::box;
  box.half_extents = {0.1, 0.2, 0.35};
  const Pose at{Vec3(5, -3, 2), rotation_deg(Vec3(1, 2, 2) / 3.0, 40.0)};
  Mesh mesh = box_mesh(box.half_extents, at);
  ASSERT_TRUE(closed(mesh));
  const std::vector<Vec3> before = mesh.vertices;
  const PrincipalFrame principal = move_to_principal_frame(mesh);
  EXPECT_NEAR(principal.volume, volume(box), 1e-12);
  EXPECT_LT((principal.frame.position - at.position).norm(), 1e-12);
  // The order of the axes may differ; the three moments are equal.
  Vec3 moments = principal.inertia;
  Vec3 expected = principal_inertia(box, volume(box));
  std::sort(moments.data(), moments.data() + 3);
  std::sort(expected.data(), expected.data() + 3);
  EXPECT_LT((moments - expected).norm(), 1e-12);
  // The body frame and the moved vertices reproduce the surface, and are principal.
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_LT((principal.frame.position + principal.frame.orientation * mesh.vertices[i] - before[i]).norm(), 1e-12);
  }
  const Solid moved = integrate(mesh);
  EXPECT_LT(moved.centre.norm(), 1e-12);
  EXPECT_LT((moved.inertia - Eigen::Matrix3d(principal.inertia.asDiagonal())).norm(), 1e-12);
}

TEST(MassProperties, TetrahedronHasTheTextbookMoments) {
  Mesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const Solid solid = integrate(mesh);
  EXPECT_NEAR(solid.volume, 1.0 / 6.0, 1e-15);
  EXPECT_LT((solid.centre - Vec3::Constant(0.25)).norm(), 1e-15);
  EXPECT_NEAR(solid.inertia(0, 0), 1.0 / 80.0, 1e-15);   // 2 (1/60 - 1/96)
  EXPECT_NEAR(solid.inertia(0, 1), 1.0 / 480.0, 1e-15);  // -(1/120 - 1/96)
}

TEST(MassProperties, ClosedFindsHolesAndTurnedTriangles) {
  Mesh mesh = box_mesh(Vec3::Ones(), {});
  EXPECT_TRUE(closed(mesh));
  std::swap(mesh.triangles[3][0], mesh.triangles[3][1]);
  EXPECT_FALSE(closed(mesh));
  mesh.triangles.erase(mesh.triangles.begin() + 3);
  EXPECT_FALSE(closed(mesh));
  EXPECT_FALSE(closed(Mesh{}));
}

TEST(ConvexHull, OfABoxWithPointsInsideAndOnItIsTheBox) {
  Mesh mesh = box_mesh(Vec3(1, 2, 3), {});
  for (int i = -4; i <= 4; ++i) {
    for (int k = -4; k <= 4; ++k) {
      mesh.vertices.emplace_back(i / 4.0, k / 2.0, 3.0);      // on a face, edges and corners too
      mesh.vertices.emplace_back(i / 5.0, k / 3.0, 0.1 * i);  // inside
    }
  }
  const Mesh hull = convex_hull(mesh);
  EXPECT_TRUE(closed(hull));
  EXPECT_NEAR(integrate(hull).volume, 48.0, 1e-9);
}

TEST(ConvexHull, OfABallOfPointsApproachesTheBall) {
  Mesh mesh;
  constexpr int kCount = 1000;
  for (int i = 0; i < kCount; ++i) {  // Fibonacci's spiral
    const double z = 1.0 - (2.0 * i + 1.0) / kCount;
    const double turn = i * M_PI * (3.0 - std::sqrt(5.0));
    const double r = std::sqrt(1.0 - z * z);
    mesh.vertices.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  const Mesh hull = convex_hull(mesh);
  EXPECT_TRUE(closed(hull));
  EXPECT_EQ(hull.vertices.size(), mesh.vertices.size());
  EXPECT_EQ(hull.triangles.size(), 2 * mesh.vertices.size() - 4);  // Euler
  EXPECT_NEAR(integrate(hull).volume / (4.0 / 3.0 * M_PI), 1.0, 0.01);
}

// Drawing programs divide faces and round coordinates: almost coplanar points by the hundred, the last digits of them
// noise of any size.
TEST(ConvexHull, OfRoundedPointsOnABoxIsTheBox) {
  std::mt19937 random(7);
  for (const double noise : {0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4}) {
    for (const double turn : {0.0, 0.7}) {
      std::uniform_real_distribution<double> off(-noise, noise);
      const Quat orientation(Eigen::AngleAxisd(turn, Vec3(1, 2, 3).normalized()));
      Mesh mesh;
      for (int axis = 0; axis < 3; ++axis) {
        for (int i = 0; i <= 8; ++i) {
          for (int k = 0; k <= 8; ++k) {
            for (const double side : {-0.5, 0.5}) {
              Vec3 p;
              p[axis] = side;
              p[(axis + 1) % 3] = i / 8.0 - 0.5;
              p[(axis + 2) % 3] = k / 8.0 - 0.5;
              mesh.vertices.emplace_back(orientation * Vec3(p + Vec3(off(random), off(random), off(random))));
            }
          }
        }
      }
      const Mesh hull = convex_hull(mesh);
      EXPECT_TRUE(closed(hull)) << noise << " at " << turn;
      EXPECT_NEAR(integrate(hull).volume, 1.0, 6.0 * noise + 1e-9) << noise << " at " << turn;
    }
  }
}

TEST(ConvexHull, OfAPlaneIsEmpty) {
  Mesh mesh;
  mesh.vertices = {Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(0, 1, 1), Vec3(1, 1, 1), Vec3(0.5, 0.5, 1)};
  EXPECT_TRUE(convex_hull(mesh).triangles.empty());
  EXPECT_TRUE(convex_hull(Mesh{}).triangles.empty());
}

/// A pillar of 0.1 x 0.2 x 0.6 m, the long side along `up` (1: y, 2: z).
Mesh pillar_along(int up) {
  Vec3 half(0.05, 0.1, 0.1);
  half[up] = 0.3;
  return box_mesh(half, {});
}

/// The same as a Collada file.
std::string as_collada(const Mesh& mesh, const char* up_axis) {
  std::string places, corners;
  for (const Vec3& v : mesh.vertices) places += fmt::format("{} {} {} ", v.x(), v.y(), v.z());
  for (const auto& t : mesh.triangles) corners += fmt::format("{} {} {} ", t[0], t[1], t[2]);
  return fmt::format(R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified><up_axis>{}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="{}">{}</float_array><technique_common>
<accessor source="#pa" count="{}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="vs"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{}"><input semantic="VERTEX" source="#vs" offset="0"/><p>{}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="v"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#v"/></scene></COLLADA>)",
                     up_axis, 3 * mesh.vertices.size(), places, mesh.vertices.size(), mesh.triangles.size(), corners);
}

/// Half the height of the body that a mesh file gives.
double half_height_m(const std::string& file, const std::string& content, const std::string& keys = "") {
  const TemporaryFolder folder;
  folder.write(file, content);
  const Scene scene = load_scene(folder.write(
      "scene.yaml", fmt::format("name: up\nbodies:\n  - {{name: pillar, shape: convex, file: {}, density_kg_m3: "
                                "1000{}}}\nusers:\n  - {{name: idle, proxy: {{shape: sphere, radius_m: 0.01, mass_kg: "
                                "0.1, position_m: [0, 5, 0]}}}}\n",
                                file, keys)));
  return bounds(scene.bodies[0].shape, scene.initial[0], scene.meshes).upper.z();
}

TEST(MeshFile, ItsUpAxisBecomesZ) {
  EXPECT_NEAR(half_height_m("a.dae", as_collada(pillar_along(2), "Z_UP")), 0.3, 1e-6);
  EXPECT_NEAR(half_height_m("a.dae", as_collada(pillar_along(1), "Y_UP")), 0.3, 1e-6);
  EXPECT_NEAR(half_height_m("a.obj", as_obj(pillar_along(2))), 0.3, 1e-6);
  EXPECT_NEAR(half_height_m("a.obj", as_obj(pillar_along(1)), ", up: y"), 0.3, 1e-6);
}

TEST(MeshFile, MayBeginWithAByteOrderMark) {
  EXPECT_NEAR(half_height_m("a.obj", "\xEF\xBB\xBF" + as_obj(pillar_along(2))), 0.3, 1e-6);
}

TEST(MeshFile, IsRefusedWhereItsNumbersHaveTooFewDigits) {
  const Mesh far = box_mesh(Vec3::Constant(0.05), {Vec3(1e5, 0, 0), Quat::Identity()});
  EXPECT_THROW((void)half_height_m("a.obj", as_obj(far)), Error);
  const Mesh near = box_mesh(Vec3::Constant(0.05), {Vec3(10, 0, 0), Quat::Identity()});
  EXPECT_NEAR(half_height_m("a.obj", as_obj(near)), 0.05, 1e-5);
}

/// A box as a mesh, at any place in its file, is positioned and moves like the box itself.
TEST(MeshBody, IsPlacedByTheFilesFrameAndHasItsCentreOfMass) {
  const TemporaryFolder folder;
  folder.write("box.obj", as_obj(box_mesh(Vec3(0.1, 0.2, 0.35), {Vec3(1, 0, 0), Quat::Identity()})));
  const Scene scene = load_scene(folder.write("scene.yaml", R"(
name: mesh
bodies:
  - {name: box, shape: box, size_m: [0.2, 0.4, 0.7], density_kg_m3: 500}
  - name: mesh
    shape: convex
    file: box.obj
    density_kg_m3: 500
    position_m: [1, 2, 3]
    rotation: {axis: [0, 0, 1], angle_deg: 90}
  - {name: again, shape: convex, file: box.obj, mass_kg: 1}
  - {name: millimetres, shape: convex, file: box.obj, scale: 0.001, density_kg_m3: 500}
  - {name: ground, shape: mesh, file: box.obj, fixed: true}
users:
  - {name: hand, proxy: {body: box}}
)"));
  const Body& box = scene.bodies[0];
  const Body& mesh = scene.bodies[1];
  EXPECT_NEAR(mesh.mass, box.mass, 1e-5 * box.mass);
  EXPECT_NEAR(box.mass, 0.2 * 0.4 * 0.7 * 500, 1e-12);
  EXPECT_LT((mesh.inertia - box.inertia).norm(), 1e-5 * box.inertia.norm());
  EXPECT_LT((scene.initial[1].position - Vec3(1, 3, 3)).norm(), 1e-6);
  EXPECT_EQ(mesh.shape.mesh, scene.bodies[2].shape.mesh) << "a file is stored once";
  EXPECT_NEAR(scene.bodies[3].mass, 1e-9 * box.mass, 1e-14 * box.mass);
  EXPECT_EQ(scene.meshes.size(), 3U);
  for (const Vec3& v : scene.meshes[mesh.shape.mesh].vertices) {
    EXPECT_LT((v.cwiseAbs() - Vec3(0.1, 0.2, 0.35)).norm(), 1e-6);
  }
  EXPECT_NEAR(scene.meshes[scene.bodies[4].shape.mesh].vertices.front().x(), 0.9, 1e-6)
      << "a fixed mesh stays as it is";
}

}  // namespace
}  // namespace subworld
