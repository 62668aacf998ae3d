#include "lab/session/variants.hpp"
#include "io/results/json.hpp"
#include "lab/coupling/analysis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace subworld {
namespace {

Scene row() { return load_scene(std::string(SCENES_FOLDER) + "/row.yaml"); }

const Body& cube_of(const Scene& scene) {
  return *std::ranges::find_if(scene.bodies,
                               [&](const Body& body) { return !body.fixed() && body.id != scene.users[0].proxy; });
}

TEST(Variants, TheFirstIsTheSceneItself) {
  const Scene scene = row();
  const Scene same = varied(scene, 0);
  EXPECT_EQ(cube_of(same).mass, cube_of(scene).mass);
  EXPECT_EQ(same.users[0].device.path.size(), scene.users[0].device.path.size());
}

TEST(Variants, DifferWithinTheirBoundsAndAreAlwaysTheSame) {
  const Scene scene = row();
  double lightest = 1e9, heaviest = 0.0;
  for (int v = 1; v <= 50; ++v) {
    const Scene other = varied(scene, v), again = varied(scene, v);
    const double mass = cube_of(other).mass / cube_of(scene).mass;
    lightest = std::min(lightest, mass);
    heaviest = std::max(heaviest, mass);
    EXPECT_GE(mass, 0.7);
    EXPECT_LE(mass, 1.4);
    EXPECT_TRUE(cube_of(other).inertia.isApprox(mass * cube_of(scene).inertia));
    EXPECT_EQ(cube_of(again).mass, cube_of(other).mass);
    EXPECT_EQ(other.body(scene.users[0].proxy).mass, scene.body(scene.users[0].proxy).mass);
    for (const Body& body : scene.bodies) {
      const double friction = other.body(body.id).material.friction / body.material.friction;
      EXPECT_GE(friction, 0.8);
      EXPECT_LE(friction, 1.25);
    }

    const auto& path = other.users[0].device.path;
    const auto& original = scene.users[0].device.path;
    ASSERT_EQ(path.size(), original.size() + 1);
    for (std::size_t i = 0; i < original.size(); ++i) {
      const Vec3 &now = path[i].displacement, &before = original[i].displacement;
      EXPECT_GE(now.norm(), 0.85 * before.norm());
      EXPECT_LE(now.norm(), 1.2 * before.norm());
      EXPECT_GE(now.dot(before), std::cos(0.1048) * now.norm() * before.norm());
    }
    const PathSegment& aside = path.back();
    EXPECT_NEAR(aside.displacement.dot(path[0].displacement), 0.0, 1e-12);
    EXPECT_LE(aside.displacement.norm(), 0.08 * path[0].displacement.norm());
    EXPECT_LE(aside.to_s, original[0].from_s);
    EXPECT_EQ(aside.displacement, again.users[0].device.path.back().displacement);
  }
  EXPECT_LT(lightest, 0.75);
  EXPECT_GT(heaviest, 1.3);
}

// All users are varied equally: a body that they hold together stays held.
TEST(Variants, TurnAllUsersAlike) {
  const Scene scene = load_scene(std::string(SCENES_FOLDER) + "/lift.yaml");
  const Scene other = varied(scene, 3);
  ASSERT_EQ(other.users.size(), 2U);
  const auto lift_of = [](const UserSpec& user) { return user.device.path.at(1).displacement; };
  EXPECT_TRUE(lift_of(other.users[0]).isApprox(lift_of(other.users[1])));
}

// A run that ends with values that are not numbers has no error, but must be counted.
TEST(Variants, OneThatDoesNotSurviveIsCounted) {
  Rows rows;
  for (int v = 0; v < 4; ++v) {
    Json row{{"scene", "row"},
             {"variant", v},
             {"scheme", "reduced"},
             {"engine", "bullet"},
             {"haptic_engine", "ode"},
             {"h_s", 0.001},
             {"ratio", 4},
             {"ratio_most", 4},
             {"box_m", 0.2},
             {"contact_depth", 0},
             {"budget_ratio", 0.4},
             {"world_substeps", 1},
             {"latency_s", 0.0},
             {"jitter_s", 0.0},
             {"device_latency_s", 0.0},
             {"loss_ratio", 0.0},
             {"deadband", 0.0},
             {"passivity", "automatic"},
             {"coupling_stiffness_n_m", 1000.0},
             {"force_error_rms", 0.01 * (v + 1)},
             {"reference_error", 0.01},
             {"survived", v != 2}};
    if (v == 2) row["force_error_rms"] = std::nan("");
    rows.push_back(std::move(row));
  }
  const Json over = over_variants(rows);
  ASSERT_EQ(over.size(), 1U);
  EXPECT_EQ(over[0]["variants"], 4);
  EXPECT_EQ(over[0]["survived"], 3);
  EXPECT_DOUBLE_EQ(over[0]["force_error_rms_median"], 0.02);
  EXPECT_DOUBLE_EQ(over[0]["force_error_rms_max"], 0.04);
}

}  // namespace
}  // namespace subworld
