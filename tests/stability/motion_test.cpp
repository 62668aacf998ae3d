// Bodies move as mechanics says, also where they are slow, float, or only begin to move: nothing that damps, holds or
// settles resting bodies may touch these. Each reference is a formula.
#include "lab/session/coupled_run.hpp"
#include "support/scene_text.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

namespace subworld {
namespace {

constexpr double kGravity_m_s2 = 9.81;
constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr const char* kIdleUser = R"(
users:
  - name: idle
    proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, position_m: [0, 40, 40], rotates: false, gravity: false}
)";

struct Choice {
  const char* engine;
  const char* preset;
};
void PrintTo(const Choice& choice, std::ostream* out) { *out << choice.engine << ' ' << choice.preset; }

class Motion : public ::testing::TestWithParam<Choice> {
 protected:
  /// Runs a scene of these settings and bodies to its end, with the engine of the test.
  void run(const std::string& settings, const std::string& bodies) {
    const auto [engine, preset] = GetParam();
    scene_ =
        load_text(fmt::format("name: motion\nsettings:\n  world: {{engine: {}, preset: {}}}\n{}materials:\n  m: "
                              "{{friction: 0.5}}\n  rough: {{friction: 1}}\nbodies:\n{}{}",
                              engine, preset, settings, bodies, kIdleUser));
    run_.emplace(scene_);
    run_->world.settle([](double) { return true; });
    ASSERT_TRUE(run_->run());
  }
  [[nodiscard]] BodyId id(const std::string& name) const {
    return std::ranges::find(scene_.bodies, name, &Body::name)->id;
  }
  [[nodiscard]] BodyState end(const std::string& name) const { return run_->world.engine().state(id(name)); }
  [[nodiscard]] Vec3 way(const std::string& name) const {
    return end(name).position - scene_.initial[index(id(name))].position;
  }

  Scene scene_;
  std::optional<CoupledRun> run_;
};

constexpr const char* kAtOnce = "  settle: {duration_s: 0}\n";

// Coulomb: s = g (sin a - mu cos a) t^2 / 2.
class Slides : public Motion {
 protected:
  void slide(double above_deg, double duration_s, double tolerance) {
    const double slope = std::atan(0.5) + above_deg * kRadPerDeg;
    const std::string turned = fmt::format("rotation: {{axis: [0, 1, 0], angle_deg: {}}}", slope / kRadPerDeg);
    std::string bodies = fmt::format("  - {{name: slope, shape: plane, fixed: true, material: m, {}}}\n", turned);
    constexpr std::array<std::array<double, 2>, 3> kSizes{{{0.1, 0.1}, {0.4, 0.1}, {1.0, 0.6}}};  // side, height
    for (std::size_t i = 0; i < kSizes.size(); ++i) {
      const auto [side_m, height_m] = kSizes[i];
      bodies += fmt::format(
          "  - {{name: box{}, shape: box, size_m: [{}, {}, {}], density_kg_m3: 500, material: m, {}, "
          "position_m: [{}, {}, {}]}}\n",
          i, side_m, side_m, height_m, turned, 0.5 * height_m * std::sin(slope), 3 * i,
          0.5 * height_m * std::cos(slope));
    }
    run(fmt::format("  duration_s: {}\n{}", duration_s, kAtOnce), bodies);
    const double expected_m = 0.5 * kGravity_m_s2 * (std::sin(slope) - 0.5 * std::cos(slope)) * duration_s * duration_s;
    for (std::size_t i = 0; i < kSizes.size(); ++i)
      EXPECT_NEAR(way(fmt::format("box{}", i)).norm(), expected_m, tolerance * expected_m) << "box " << i;
  }
};
TEST_P(Slides, two_degrees_above_the_angle_of_friction) { slide(2.0, 4.0, 0.03); }
TEST_P(Slides, a_third_of_a_degree_above_the_angle_of_friction) { slide(0.3, 6.0, 0.1); }

// A cube on an edge: (2/3) s^2 a'' = g s / sqrt(2) sin(a), a: angle from the balance.
double fall_time_s(double side_m, double from_deg) {
  constexpr double kStep_s = 1e-5;
  double angle = from_deg * kRadPerDeg, rate = 0.0, t = 0.0;
  for (; angle < 0.25 * std::numbers::pi; t += kStep_s) {
    rate += kStep_s * 1.5 * kGravity_m_s2 / (std::numbers::sqrt2 * side_m) * std::sin(angle);
    angle += kStep_s * rate;
  }
  return t;
}
class Topples : public Motion {};
TEST_P(Topples, in_the_time_of_a_pendulum) {
  constexpr std::array<std::array<double, 2>, 3> kCubes{
      {{1.0, 0.5}, {1.0, 2.0}, {0.1, 0.5}}};  // side, beyond the balance
  for (const auto [side_m, beyond_deg] : kCubes) {
    const double half_m = side_m / std::numbers::sqrt2;
    const std::string bodies = fmt::format(
        "  - {{name: floor, shape: plane, fixed: true, material: rough}}\n  - {{name: cube, shape: box, size_m: [{0}, "
        "{0}, {0}], density_kg_m3: 500, material: rough, position_m: [{1}, 0, {2}], rotation: {{axis: [0, 1, 0], "
        "angle_deg: {3}}}}}\n",
        side_m, half_m * std::sin(beyond_deg * kRadPerDeg), half_m * std::cos(beyond_deg * kRadPerDeg),
        45.0 + beyond_deg);
    const double expected_s = fall_time_s(side_m, beyond_deg);
    const auto tilt_deg = [&](double duration_s) {
      run(fmt::format("  duration_s: {}\n{}", duration_s, kAtOnce), bodies);
      const Vec3 axis = end("cube").orientation * Vec3::UnitX();
      return std::abs(std::atan2(axis.z(), axis.x())) / kRadPerDeg;
    };
    EXPECT_LT(tilt_deg(0.95 * expected_s), 89.0) << side_m << " m, " << beyond_deg << " degrees: too early";
    EXPECT_GT(tilt_deg(1.05 * expected_s + 0.02), 89.0) << side_m << " m, " << beyond_deg << " degrees: too late";
  }
}

// Newton's first law.
class Floats : public Motion {};
TEST_P(Floats, on_without_gravity) {
  std::string bodies;
  constexpr std::array kSpeeds{0.2, 0.01, 1e-3, 1e-5};  // m/s
  for (std::size_t i = 0; i < kSpeeds.size(); ++i) {
    bodies += fmt::format(
        "  - {{name: box{0}, shape: box, size_m: [1, 1, 1], mass_kg: 1, position_m: [{1}, 0, 0], "
        "velocity_m_s: [0, {2}, 0], angular_velocity_rad_s: [0, 0, {2}]}}\n",
        i, 5 * i, kSpeeds[i]);
  }
  run("  duration_s: 4\n  gravity_m_s2: [0, 0, 0]\n", bodies);
  for (std::size_t i = 0; i < kSpeeds.size(); ++i) {
    const std::string name = fmt::format("box{}", i);
    EXPECT_NEAR(way(name).y(), 4.0 * kSpeeds[i], 1e-4 * 4.0 * kSpeeds[i] + 1e-7) << kSpeeds[i] << " m/s";
    const Quat turned = end(name).orientation;
    EXPECT_NEAR(2.0 * std::atan2(turned.z(), turned.w()), 4.0 * kSpeeds[i], 1e-3 * 4.0 * kSpeeds[i] + 1e-7);
  }
}

// s = g t^2 / 2, also from the top of a throw.
class Falls : public Motion {};
TEST_P(Falls, in_weak_gravity) {
  const double g = 0.0057, up_m_s = 0.01, duration_s = 8.0;
  run(fmt::format("  duration_s: {}\n  gravity_m_s2: [0, 0, {}]\n{}", duration_s, -g, kAtOnce),
      fmt::format("  - {{name: ground, shape: plane, fixed: true}}\n"
                  "  - {{name: rock, shape: box, size_m: [1, 1, 1], mass_kg: 1000, position_m: [0, 0, 2]}}\n"
                  "  - {{name: stone, shape: sphere, radius_m: 0.1, mass_kg: 10, position_m: [5, 0, 2]}}\n"
                  "  - {{name: thrown, shape: box, size_m: [1, 1, 1], mass_kg: 1000, position_m: [9, 0, 2], "
                  "velocity_m_s: [0, 0, {}]}}\n",
                  up_m_s));
  const double fallen_m = 0.5 * g * duration_s * duration_s;
  EXPECT_NEAR(way("rock").z(), -fallen_m, 0.01 * fallen_m);
  EXPECT_NEAR(way("stone").z(), -fallen_m, 0.01 * fallen_m);
  EXPECT_NEAR(way("thrown").z(), up_m_s * duration_s - fallen_m, 0.01 * fallen_m);
}

class Launched : public Motion {};
TEST_P(Launched, bodies_have_their_velocity_when_the_run_begins) {
  run("  duration_s: 0.04\n",
      "  - {name: floor, shape: plane, fixed: true, material: m}\n"
      "  - {name: cube, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 1, material: m, position_m: [0, 0, 0.05], "
      "velocity_m_s: [2, 0, 0]}\n"
      "  - {name: ball, shape: sphere, radius_m: 0.05, mass_kg: 1, material: m, position_m: [0, 1, 0.05], "
      "velocity_m_s: [0, 0, 3]}\n"
      "  - {name: free, shape: sphere, radius_m: 0.05, mass_kg: 1, gravity: false, position_m: [0, 2, 1], "
      "velocity_m_s: "
      "[1, 0, 0]}\n");
  EXPECT_NEAR(way("cube").x(), 2.0 * 0.04 - 0.5 * 0.5 * kGravity_m_s2 * 0.04 * 0.04, 0.002);
  EXPECT_NEAR(way("ball").z(), 3.0 * 0.04 - 0.5 * kGravity_m_s2 * 0.04 * 0.04, 0.002);
  EXPECT_NEAR(way("free").x(), 0.04, 1e-6);
}

// Euler: the energy and the vector of the angular momentum stay.
class Spins : public Motion {};
TEST_P(Spins, with_constant_energy_and_momentum) {
  run(fmt::format("  duration_s: 10\n  gravity_m_s2: [0, 0, 0]\n{}", kAtOnce),
      "  - {name: stable, shape: box, size_m: [0.1, 0.2, 0.3], mass_kg: 1, position_m: [0, 0, 0], "
      "angular_velocity_rad_s: [20, 0.5, 0.5]}\n"
      "  - {name: flips, shape: box, size_m: [0.1, 0.2, 0.3], mass_kg: 1, position_m: [6, 0, 0], "
      "angular_velocity_rad_s: [0.01, 10, 0.01]}\n"
      "  - {name: rod, shape: cylinder, radius_m: 0.005, length_m: 1, mass_kg: 1, position_m: [4, 0, 0], "
      "angular_velocity_rad_s: [0.3, 0, 100]}\n");
  for (const char* name : {"stable", "flips", "rod"}) {
    const Vec3& inertia = scene_.body(id(name)).inertia;
    const auto momentum = [&](const BodyState& at) {
      return Vec3(at.orientation * inertia.cwiseProduct(at.orientation.conjugate() * at.angular_velocity));
    };
    const BodyState& begin = scene_.initial[index(id(name))];
    const Vec3 before = momentum(begin), after = momentum(end(name));
    EXPECT_LT((after - before).norm(), 1e-3 * before.norm()) << name;
    const double energy = before.dot(begin.angular_velocity);
    EXPECT_NEAR(after.dot(end(name).angular_velocity), energy, 1e-2 * energy) << name;
  }
}

// A rod that turns by 46 degrees a cycle meets a post that its end would pass between two cycles.
class Sweeps : public Motion {};
TEST_P(Sweeps, into_what_is_in_its_way) {
  run(fmt::format("  duration_s: 0.016\n  gravity_m_s2: [0, 0, 0]\n{}", kAtOnce),
      "  - {name: post, shape: cylinder, radius_m: 0.004, length_m: 0.5, fixed: true, position_m: [0, 0.4, 0]}\n"
      "  - {name: box, shape: box, size_m: [1, 0.01, 0.01], mass_kg: 1, position_m: [0, 0, 0], angular_velocity_rad_s: "
      "[0, 0, 200]}\n"
      "  - {name: square_post, shape: box, size_m: [0.008, 0.008, 0.5], fixed: true, position_m: [5, 0.4, 0]}\n"
      "  - {name: pill, shape: capsule, radius_m: 0.005, length_m: 0.99, mass_kg: 1, position_m: [5, 0, 0], rotation: "
      "{axis: [0, 1, 0], angle_deg: 90}, angular_velocity_rad_s: [0, 0, 200]}\n");
  for (const char* name : {"box", "pill"}) EXPECT_LT(end(name).angular_velocity.z(), 100.0) << name;
}

/// A mesh in the plane z = 0 over [-1, 3] x [-1, 3] m: cells with diagonals that alternate, or all turn the same way.
std::string flat_mesh(int cells_x, int cells_y, bool alternate) {
  std::string mesh;
  for (int i = 0; i <= cells_x; ++i)
    for (int k = 0; k <= cells_y; ++k)
      mesh += fmt::format("v {} {} 0\n", 4.0 * i / cells_x - 1.0, 4.0 * k / cells_y - 1.0);
  for (int i = 0; i < cells_x; ++i) {
    for (int k = 0; k < cells_y; ++k) {
      const int a = i * (cells_y + 1) + k + 1, b = a + cells_y + 1;
      mesh += alternate && (i + k) % 2 != 0 ? fmt::format("f {0} {1} {2}\nf {1} {3} {2}\n", a, b, a + 1, b + 1)
                                            : fmt::format("f {0} {1} {3}\nf {0} {3} {2}\n", a, b, a + 1, b + 1);
    }
  }
  return mesh;
}
// Without friction, on a floor of many parts that are flush: Newton's first law. Its inner edges are not there.
class Glides : public Motion {
 protected:
  void glide(const std::string& floor, const std::string& mesh, bool rotates) {
    const TemporaryFolder folder;
    folder.write("floor.obj", mesh);
    folder.write("octagon.obj",
                 "v 5 2 -3\nv 2 5 -3\nv -2 5 -3\nv -5 2 -3\nv -5 -2 -3\nv -2 -5 -3\nv 2 -5 -3\nv 5 -2 -3\n"
                 "v 5 2 3\nv 2 5 3\nv -2 5 3\nv -5 2 3\nv -5 -2 3\nv -2 -5 3\nv 2 -5 3\nv 5 -2 3\n"
                 "f 1 2 3 4 5 6 7 8\nf 16 15 14 13 12 11 10 9\n");
    const auto [engine, preset] = GetParam();
    const std::string rest = fmt::format(
        ", mass_kg: 0.5, material: smooth, rotates: {}, velocity_m_s: [1, 0.07, 0]}}\n", rotates ? "true" : "false");
    scene_ = load_scene(folder.write(
        "scene.yaml",
        fmt::format(
            "name: glide\nsettings:\n  duration_s: 2\n{}  world: {{engine: {}, preset: {}}}\nmaterials:\n  "
            "smooth: {{friction: 0}}\nbodies:\n{}"
            "  - {{name: ball, shape: sphere, radius_m: 0.03, position_m: [-0.5, 0.5, 0.03]{}"
            "  - {{name: puck, shape: cylinder, radius_m: 0.05, length_m: 0.04, position_m: [-0.5, -0.7, 0.02]{}"
            "  - {{name: pill, shape: capsule, radius_m: 0.03, length_m: 0.1, position_m: [-0.5, -0.4, 0.03], "
            "rotation: {{axis: [0, 1, 0], angle_deg: 90}}{}"
            "  - {{name: box, shape: box, size_m: [0.1, 0.1, 0.1], position_m: [-0.5, 0.0, 0.05]{}"
            "  - {{name: hull, shape: convex, file: octagon.obj, scale: 0.01, position_m: [-0.5, 0.8, 0.03]{}{}",
            kAtOnce, engine, preset, floor, rest, rest, rest, rest, rest, kIdleUser)));
    run_.emplace(scene_);
    ASSERT_TRUE(run_->run());
    for (const char* name : {"ball", "puck", "pill", "box", "hull"}) {
      EXPECT_NEAR(end(name).linear_velocity.x(), 1.0, 1e-3) << name;
      EXPECT_NEAR(end(name).linear_velocity.y(), 0.07, 1e-3) << name;
    }
  }
};
constexpr const char* kMeshFloor = "  - {name: floor, shape: mesh, file: floor.obj, fixed: true, material: smooth}\n";
TEST_P(Glides, over_a_flat_mesh) { glide(kMeshFloor, flat_mesh(40, 40, true), false); }
TEST_P(Glides, over_small_triangles) { glide(kMeshFloor, flat_mesh(160, 160, false), true); }
TEST_P(Glides, over_slivers) { glide(kMeshFloor, flat_mesh(1000, 1, false), true); }
TEST_P(Glides, along_slivers) { glide(kMeshFloor, flat_mesh(1, 1000, false), true); }
class GlidesOverSeams : public Glides {};
TEST_P(GlidesOverSeams, over_tiles) {
  std::string tiles;
  for (int i = 0; i < 256; ++i)
    tiles += fmt::format(
        "  - {{name: tile{}, shape: box, size_m: [0.25, 0.25, 0.05], fixed: true, material: smooth, position_m: [{}, "
        "{}, "
        "-0.025]}}\n",
        i, 0.25 * (i / 16) - 0.875, 0.25 * (i % 16) - 0.875);
  glide(tiles, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", true);
}

TEST_P(GlidesOverSeams, up_to_a_wall_beside_its_floor) {
  run(fmt::format("  duration_s: 1\n{}", kAtOnce),
      "  - {name: floor, shape: box, size_m: [2, 2, 0.1], fixed: true, material: m, position_m: [0, 0, -0.05]}\n"
      "  - {name: wall, shape: box, size_m: [0.1, 2, 0.2], fixed: true, material: m, position_m: [0.15, 0, 0]}\n"
      "  - {name: box, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 1, material: m, position_m: [0, 0, 0.05], "
      "velocity_m_s: [1, 0, 0]}\n");
  EXPECT_LT(way("box").x(), 0.06) << "0.10 m without the wall";
}

/// Runs a tool of one user along its path; the force on the operator at each haptic step.
class Tool : public Motion {
 protected:
  const std::vector<Vec3>& feel(const std::string& bodies, const std::string& proxy, const std::string& path,
                                double duration_s) {
    const auto [engine, preset] = GetParam();
    scene_ = load_text(fmt::format(
        "name: tool\nsettings:\n  duration_s: {}\n{}  world: {{engine: {}, preset: {}}}\n  haptic: {{engine: {}, "
        "preset: {}}}\nmaterials:\n  smooth: {{friction: 0}}\nbodies:\n{}users:\n  - name: hand\n    proxy: {{{}, "
        "mass_kg: 0.1, material: smooth, rotates: false, gravity: false}}\n    device:\n      path:\n{}",
        duration_s, kAtOnce, engine, preset, engine, preset, bodies, proxy, path));
    keep_users(scene_, 1);
    run_.emplace(scene_);
    EXPECT_TRUE(run_->run());
    return run_->felt[0].on_operator;
  }
};

// Nothing touches a tool between two blocks that leave it some play: it feels what it feels without them.
class Clearance : public Tool {};
TEST_P(Clearance, is_not_felt) {
  constexpr const char* kPath = "        - {move: [0, 0, -0.04], during_s: [0.1, 0.6]}\n";
  for (const char* shape : {"shape: cylinder, radius_m: 0.01, length_m: 0.05", "shape: box, size_m: [0.02, 0.02, 0.05]",
                            "shape: capsule, radius_m: 0.01, length_m: 0.03"}) {
    const std::string proxy = fmt::format("{}, position_m: [0, 0, 0.058]", shape);
    const std::vector<Vec3> free =
        feel("  - {name: far, shape: plane, fixed: true, position_m: [0, 0, -9]}\n", proxy, kPath, 0.7);
    for (const double play_m : {2e-5, 1e-4, 5e-4}) {
      std::string blocks;
      for (const int side : {-1, 1})
        blocks += fmt::format(
            "  - {{name: wall{}, shape: box, size_m: [0.02, 0.006, 0.06], fixed: true, material: "
            "smooth, position_m: [{}, 0, 0]}}\n",
            side + 1, side * (0.02 + play_m));
      const std::vector<Vec3>& felt = feel(blocks, proxy, kPath, 0.7);
      double most_n = 0.0;
      for (std::size_t i = 0; i < felt.size(); ++i) most_n = std::max(most_n, (felt[i] - free[i]).norm());
      EXPECT_LT(most_n, 0.02) << shape << ", play of " << play_m << " m";
    }
  }
}

constexpr Choice kChoices[] = {{"bullet", "fast"}, {"bullet", "quality"}, {"ode", "fast"}, {"ode", "quality"}};
const auto kName = [](const auto& one) { return fmt::format("{}_{}", one.param.engine, one.param.preset); };
INSTANTIATE_TEST_SUITE_P(Engines, Slides, ::testing::ValuesIn(kChoices), kName);
INSTANTIATE_TEST_SUITE_P(Engines, Topples, ::testing::ValuesIn(kChoices), kName);
INSTANTIATE_TEST_SUITE_P(Engines, Floats, ::testing::ValuesIn(kChoices), kName);
INSTANTIATE_TEST_SUITE_P(Engines, Falls, ::testing::ValuesIn(kChoices), kName);
INSTANTIATE_TEST_SUITE_P(Engines, Launched, ::testing::ValuesIn(kChoices), kName);
const auto kOfBullet = ::testing::Values(Choice{"bullet", "fast"}, Choice{"bullet", "quality"});
INSTANTIATE_TEST_SUITE_P(Bullet, Sweeps, kOfBullet, kName);
INSTANTIATE_TEST_SUITE_P(Engines, Glides, ::testing::ValuesIn(std::span(kChoices).first(3)), kName);
INSTANTIATE_TEST_SUITE_P(Bullet, GlidesOverSeams, kOfBullet, kName);
INSTANTIATE_TEST_SUITE_P(Engines, Clearance, ::testing::ValuesIn(kChoices), kName);
INSTANTIATE_TEST_SUITE_P(Bullet, Spins, kOfBullet, kName);

}  // namespace
}  // namespace subworld
