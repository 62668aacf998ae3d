// Engines against the mechanics of rigid bodies; each test names its formula.

#include "support/engines.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>

namespace subworld {
namespace {

using test::at;
using test::cube;
using test::floor_plane;
using test::kBody;
using test::kFloor;
using test::kG;
using test::Tested;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMu = 0.5;

class Stability : public testing::TestWithParam<Tested> {
 protected:
  Stability() : dt(GetParam().dt) {}
  static int steps(double seconds) { return GetParam().steps(seconds); }
  double dt;
};

/// A cube on a plane whose normal is z, tilted by `angle` towards `heading` (rad, about z): gravity turns instead.
std::unique_ptr<Engine> slope(const Tested& tested, double angle, double heading) {
  EngineSettings settings = tested.settings();
  const double down = std::sin(angle);
  settings.gravity = kG * Vec3(down * std::cos(heading), down * std::sin(heading), -std::cos(angle));
  auto engine = make_engine(settings, {});
  engine->add(floor_plane(kFloor), BodyState{});
  engine->add(cube(kBody), at(0, 0, 0.05));
  return engine;
}

constexpr double kHeadings[] = {0.0, 25.0 * kDegree, 45.0 * kDegree};

/// Coulomb: a body slips where tan(angle) > mu.
TEST_P(Stability, SlipAngleIsThatOfMu) {
  const double critical = std::atan(kMu);
  for (const double heading : kHeadings) {
    SCOPED_TRACE(heading / kDegree);
    const auto moved = [&](double angle) {
      const auto engine = slope(GetParam(), angle, heading);
      test::run(*engine, steps(1.0), dt);
      return engine->state(kBody).position.head<2>().norm();
    };
    // 0.1 degrees above, a t^2 / 2 is 9.6 mm after 1 s if it slides from the start; the start may be delayed. Havok
    // creeps by 0.9 mm in the second.
    EXPECT_LT(moved(critical - 0.1 * kDegree), GetParam().engine == "havok" ? 1e-3 : 5e-4);
    EXPECT_GT(moved(critical + 0.1 * kDegree), 3e-3);
  }
}

/// v = g (sin a - mu cos a) t.
TEST_P(Stability, SlidingSpeedOnASlope) {
  const double angle = 40.0 * kDegree;
  for (const double heading : kHeadings) {
    SCOPED_TRACE(heading / kDegree);
    const auto engine = slope(GetParam(), angle, heading);
    test::run(*engine, steps(1.0), dt);
    const double expected = kG * (std::sin(angle) - kMu * std::cos(angle)) * dt * steps(1.0);
    const Vec3 velocity = engine->state(kBody).linear_velocity;
    EXPECT_NEAR(velocity.norm(), expected, 0.01 * expected);
    EXPECT_NEAR(std::atan2(velocity.y(), velocity.x()), heading, 1.0 * kDegree);
  }
}

/// Coulomb with mu > 1: a thin plate, so that the push does not tip it, does not move for F < mu m g; above, v = (F / m
/// - mu g) t.
TEST_P(Stability, FrictionIsAsGivenWithLargeMu) {
  constexpr double kLargeMu = 50.0;
  const Vec3 half(1.0, 1.0, 0.002);
  const auto slides = [&](double push) {
    auto engine = make_engine(GetParam().settings(), {});
    Body floor = floor_plane(kFloor), plate = cube(kBody, 1.0, 1.0);
    floor.material.friction = plate.material.friction = kLargeMu;
    plate.shape.half_extents = half;
    plate.inertia = plate.mass / 3.0 * Vec3(half.y() * half.y(), half.x() * half.x(), 2.0 * half.x() * half.x());
    engine->add(floor, BodyState{});
    engine->add(plate, at(0, 0, half.z()));
    test::run(*engine, steps(0.2), dt);
    for (int i = 0; i < steps(0.1); ++i) {
      engine->apply_force(kBody, push * kG * Vec3::UnitX(), Vec3::Zero());
      engine->step(dt);
    }
    return engine->state(kBody).linear_velocity.x();
  };
  const double unbraked = kLargeMu * kG * dt * steps(0.1);
  EXPECT_LT(std::abs(slides(0.8 * kLargeMu)), 0.01 * unbraked);  // Havok creeps by 0.006 of it
  const double expected = 0.4 * unbraked;
  EXPECT_NEAR(slides(1.4 * kLargeMu), expected, 0.05 * expected);
}

/// In a pile at rest each cube carries those above it, in every step, also if its corners are not on those of the next
/// cube (statics).
TEST_P(Stability, PileAtRestPushesSteadily) {
  constexpr unsigned kCount = 4;
  constexpr double kMass = 1.0, kTurn = 0.01;
  const auto engine = GetParam().make();
  engine->add(floor_plane(kFloor), BodyState{});
  for (unsigned i = 1; i <= kCount; ++i) {
    BodyState state = at(0, 0, 0.1 * i - 0.05);
    state.orientation = Eigen::AngleAxisd(kTurn * i, Vec3::UnitZ());
    engine->add(cube(BodyId{i}, 0.1, kMass), state);
  }
  test::run(*engine, steps(1.0), dt);
  for (int n = 0; n < steps(1.0); ++n) {
    engine->step(dt);
    std::array<double, kCount> carried{};
    for (const Contact& c : engine->contacts()) carried[index(c.a)] += c.normal_impulse / dt;
    for (unsigned i = 0; i < kCount; ++i) {
      const double weight = kG * kMass * (kCount - i);
      ASSERT_NEAR(carried[i], weight, 0.05 * weight) << "under cube " << i + 1 << ", step " << n;
    }
  }
}

/// Without torque, L = R I R^T w and E = w.L / 2 are constant (Euler). About the middle axis the body tumbles. In an
/// engine without gyroscopic torque, w is constant instead.
TEST_P(Stability, FreeRotationKeepsMomentumAndEnergy) {
  const auto engine = GetParam().make();
  Body body = cube(kBody, 0.1, 1.0);
  body.gravity = false;
  body.inertia = Vec3(0.001, 0.002, 0.0026);
  BodyState start = at(0, 0, 1);
  start.angular_velocity = Vec3(0.5, 8.0, 0.5);
  engine->add(body, start);
  const auto momentum = [&] {
    const BodyState s = engine->state(kBody);
    const Eigen::Matrix3d turn = s.orientation.toRotationMatrix();
    return Vec3(turn * body.inertia.asDiagonal() * turn.transpose() * s.angular_velocity);
  };
  const auto energy = [&] { return 0.5 * momentum().dot(engine->state(kBody).angular_velocity); };
  const Vec3 momentum_before = momentum();
  const double energy_before = energy();
  bool tumbled = false;
  for (int i = 0; i < steps(2.0); ++i) {
    engine->step(dt);
    tumbled = tumbled || (engine->state(kBody).orientation * Vec3::UnitY()).y() < -0.5;
  }
  // Rounding adds up to at most one unit per step.
  const double room = 1e-4 + 4.0 * steps(2.0) * engine->capabilities().precision;
  if (engine->capabilities().gyroscopic == Fidelity::absent) {
    EXPECT_LT((engine->state(kBody).angular_velocity - start.angular_velocity).norm(),
              room * start.angular_velocity.norm());
    return;
  }
  EXPECT_LT((momentum() - momentum_before).norm(), 0.01 * momentum_before.norm());
  EXPECT_NEAR(momentum().norm(), momentum_before.norm(), room * momentum_before.norm());
  EXPECT_NEAR(energy(), energy_before, room * energy_before);
  RecordProperty("momentum_error", std::to_string((momentum() - momentum_before).norm() / momentum_before.norm()));
  RecordProperty("energy_error", std::to_string(energy() / energy_before - 1.0));
  EXPECT_TRUE(tumbled) << "rotation about the middle axis is unstable";
}

/// Whether a stack of three cubes stands still on a table for 1 s in this unit of length. Tolerance a twentieth: no
/// cube moves by more than that share of its side, and the load on the table differs by no more from the weight
/// (statics).
bool stands(const Tested& tested, double side, double length_unit_m) {
  EngineSettings settings = tested.settings();
  settings.length_unit_m = length_unit_m;
  const auto engine = make_engine(settings, {});
  const double mass = 2500.0 * side * side * side;
  engine->add(cube(kFloor, 1.0, 0.0), at(0, 0, -0.5));
  const auto place = [side](unsigned i) { return at(0, 0, (i - 0.5) * side); };
  for (unsigned i = 1; i <= 3; ++i) engine->add(cube(BodyId{i}, side, mass), place(i));
  const int count = tested.steps(1.0);
  double on_table = 0.0, moved = 0.0;
  for (int n = 0; n < count; ++n) {
    engine->step(tested.dt);
    for (unsigned i = 1; i <= 3; ++i) {
      moved = std::max(moved, (engine->state(BodyId{i}).position - place(i).position).norm());
    }
    if (2 * n < count) continue;
    for (const Contact& c : engine->contacts()) on_table += c.a == kFloor ? c.normal_impulse : 0.0;
  }
  const double weight = 3 * mass * kG * tested.dt * (count / 2);
  return moved < 0.05 * side && std::abs(on_table - weight) < 0.05 * weight;
}

/// Havok lets a box below 0.035 units fall through, and ODE's `fast` creeps by 0.7 mm/s in a unit of 1 m: there another
/// unit makes small parts stand. The other engines do not need one (common/physics/README.md, Units).
TEST_P(Stability, SmallPartsStandInAUnitOfTheirOwn) {
  const Tested& tested = GetParam();
  const bool needs_it = tested.engine == "havok" || (tested.engine == "ode" && tested.preset == "fast");
  for (const double side : {0.005, 0.002}) {
    EXPECT_TRUE(stands(tested, side, 0.01)) << side;
    if (needs_it) {
      EXPECT_FALSE(stands(tested, side, 1.0)) << side << ": no unit needed, unlike in the README";
    }
  }
}

/// After n impacts a ball that fell from h rises to e^(2n) h.
TEST_P(Stability, BounceHeight) {
  constexpr double kRadius = 0.05;
  struct Drop {
    double restitution;
    int bounces;
    double height_m;
  };
  // Each height gives another time of contact within a step.
  for (const auto& [restitution, bounces, height_m] :
       {Drop{1.0, 4, 0.5}, Drop{0.5, 2, 0.5}, Drop{1.0, 1, 0.31}, Drop{1.0, 1, 0.37}, Drop{1.0, 1, 0.43},
        Drop{1.0, 1, 0.56}, Drop{1.0, 1, 0.62}, Drop{1.0, 1, 0.69}}) {
    SCOPED_TRACE(fmt::format("restitution {}, from {} m", restitution, height_m));
    const auto engine = GetParam().make();
    Body floor = floor_plane(kFloor);
    floor.material.restitution = 1.0;
    Body ball = test::ball_proxy(kBody, kRadius);
    ball.gravity = true;
    ball.rotates = true;
    ball.material.restitution = restitution;
    engine->add(floor, BodyState{});
    engine->add(ball, at(0, 0, kRadius + height_m));
    std::vector<double> tops;
    bool rising = false;
    int still = 0;
    while (static_cast<int>(tops.size()) < bounces) {
      ASSERT_LT(tops.size() + 1, 100U);
      const double before = engine->state(kBody).position.z();
      engine->step(dt);
      const double speed = engine->state(kBody).linear_velocity.z();
      if (rising && speed <= 0.0) tops.push_back(before - kRadius);
      // An engine may stop it for a step before it bounces.
      still = std::abs(speed) < 1e-3 && before < kRadius + 1e-3 ? still + 1 : 0;
      if (still > 10) break;
      rising = speed > 0.0;
    }
    ASSERT_EQ(static_cast<int>(tops.size()), bounces) << "bounces were lost";
    for (int n = 0; n < bounces; ++n) {
      const double expected = height_m * std::pow(restitution, 2.0 * (n + 1));
      EXPECT_NEAR(tops[n], expected, 0.02 * (n + 1) * expected) << "bounce " << n + 1;
    }
  }
}

/// v = g t whatever the sub-steps, and z = g t^2 / 2 but for the order of integration, g dt t / 2.
TEST_P(Stability, FreeFallIsThatOfNewton) {
  for (const int substeps : {1, 2, 7}) {
    EngineSettings settings = GetParam().settings();
    settings.substeps = substeps;
    const auto engine = make_engine(settings, {});
    engine->add(cube(kBody), at(0, 0, 0));
    test::run(*engine, steps(0.5), dt);
    const double t = dt * steps(0.5);
    const double rounding = 1e3 * GetParam().precision();
    EXPECT_NEAR(engine->state(kBody).linear_velocity.z(), -kG * t, rounding) << substeps;
    EXPECT_NEAR(engine->state(kBody).position.z(), -0.5 * kG * t * t, 0.5 * kG * t * dt / substeps * 1.01 + rounding)
        << substeps;
  }
}

/// Newton's second law for a pushed row: a = F / (3 m) - mu g, and the floor carries each body's weight.
TEST_P(Stability, ASlidingRowIsFeltEvenly) {
  const auto engine = GetParam().make();
  engine->add(floor_plane(kFloor), BodyState{});
  for (unsigned i = 0; i < 3; ++i) engine->add(cube(BodyId{i + 1}), at(0.1 * i, 0, 0.05));
  test::run(*engine, steps(0.5), dt);
  const double push = 1.5 * kMu * 3 * 0.2 * kG;
  double least = 1e9, most = 0.0;
  const double before = engine->state(kBody).linear_velocity.x();
  for (int i = 0; i < steps(0.5); ++i) {
    engine->apply_force(kBody, Vec3(push, 0, 0), Vec3::Zero());
    engine->step(dt);
    double floor = 0.0;
    for (const Contact& c : engine->contacts()) {
      if (c.a == kFloor) floor += c.normal_impulse / dt;
    }
    if (i < steps(0.1)) continue;
    least = std::min(least, floor);
    most = std::max(most, floor);
  }
  EXPECT_NEAR(engine->state(kBody).linear_velocity.x() - before, 0.5 * kMu * kG * dt * steps(0.5),
              0.02 * kMu * kG * 0.5);
  const double weight = 3 * 0.2 * kG;
  EXPECT_GT(least, 0.94 * weight);
  EXPECT_LT(most, 1.06 * weight);
}

INSTANTIATE_TEST_SUITE_P(Engines, Stability, testing::ValuesIn(test::tested_engines({0.001}, {0.001})), test::name_of);

}  // namespace
}  // namespace subworld
