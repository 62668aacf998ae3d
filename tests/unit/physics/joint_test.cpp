// Joints against formulas of mechanics, in the engines that have them.
#include "model/joint.hpp"
#include "model/error.hpp"
#include "physics/shells/live_engine.hpp"
#include "support/engines.hpp"
#include "support/grid.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

namespace subworld {
namespace {

using test::kG;

constexpr double kFrame_m = 1e-4, kFrame_rad = M_PI / 180.0 * 0.1;  ///< largest errors of a joint

const std::string kPost =
    "  - {name: post, shape: box, size_m: [0.02, 0.02, 0.02], fixed: true, position_m: [0, 0, 1]}\n";

/// A scene's bodies and joints in one engine. Checks after each step that the joints hold.
struct Bench {
  Bench(const test::Tested& tested, const std::string& bodies, const std::string& joints)
      : scene(load_text("name: bench\nbodies:\n" + kPost + bodies + "joints:\n" + joints +
                        "users: [{name: user, proxy: {shape: sphere, radius_m: 0.01, mass_kg: 0.1, "
                        "position_m: [0, 0, 90], gravity: false}}]\n")),
        engine(tested.make(scene.meshes)),
        dt(tested.dt) {
    engine->set_joints(scene.joints);
    for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
  }
  ~Bench() {
    EXPECT_LT(off_m, kFrame_m);
    EXPECT_LT(off_rad, kFrame_rad);
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  template <class Before = void (*)()>
  void run(
      double seconds, Before&& before = [] {}) {
    for (long i = std::lround(seconds / dt); i > 0; --i) {
      before();
      engine->step(dt);
      for (std::size_t j = 0; j < scene.joints.size(); ++j) look_at(j);
    }
  }
  void look_at(std::size_t j) {
    if (j == broken) return;
    const JointPlace place = place_at(j);
    for (std::size_t i = 0; i < 6; ++i) {
      if (scene.joints[j].axes[i].free) continue;
      double& most = i < 3 ? off_m : off_rad;
      most = std::max(most, std::abs(place.coordinates[i]));
    }
  }
  JointPlace place_at(std::size_t j) const {
    const Joint& joint = scene.joints[j];
    return place_of(joint, pose_of(engine->state(joint.a)), pose_of(engine->state(joint.b)));
  }
  double slide(std::size_t j) const { return place_at(j).coordinates[2]; }
  double turn(std::size_t j) const { return place_at(j).coordinates[5]; }
  BodyId id(std::string_view name) const { return std::ranges::find(scene.bodies, name, &Body::name)->id; }
  BodyState state(std::string_view name) const { return engine->state(id(name)); }
  double energy() const {
    double sum = 0.0;
    for (const Body& body : scene.bodies) {
      const BodyState s = engine->state(body.id);
      if (!body.fixed() && body.gravity) sum += kinetic_energy(body, s) + body.mass * kG * s.position.z();
    }
    return sum;
  }

  Scene scene;
  std::unique_ptr<Engine> engine;
  double dt;
  std::size_t broken = 99;
  double off_m = 0.0, off_rad = 0.0;
};

class JointOfEngine : public testing::TestWithParam<test::Tested> {
 protected:
  bool fast() const { return GetParam().preset == "fast"; }
  double dt = GetParam().dt;
};

/// Of a rod of length l about its end, released at an angle from below: 4 sqrt(2 l / (3 g)) K(sin(angle / 2)).
double period_of_rod(double length, double angle) {
  double a = 1.0, b = std::cos(angle / 2.0);
  for (int i = 0; i < 20; ++i) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return 2.0 * M_PI / a * std::sqrt(2.0 * length / (3.0 * kG));
}

TEST_P(JointOfEngine, APendulumKeepsItsPeriodAndItsEnergy) {
  Bench bench(GetParam(),
              "  - {name: rod, shape: box, size_m: [0.4, 0.001, 0.001], mass_kg: 0.2, "
              "position_m: [0.17320508, 0, 0.9], rotation: {axis: [0, 1, 0], angle_deg: 30}}\n",
              "  - {name: pin, type: hinge, bodies: [rod, post], at_m: [0, 0, 1], axis: [0, 1, 0]}\n");
  const double start = bench.energy(), scale = 0.2 * kG * 0.1;
  double first_s = 0.0, last_s = 0.0, before = -1.0;
  int half_periods = -1;
  const double most_s = fast() ? 60.0 : 6.0;
  for (double time = dt; time < most_s; time += dt) {
    bench.run(dt);
    const double angle = bench.turn(0) - M_PI / 3.0;  // 0: below
    if (before * angle < 0.0) {
      last_s = time;
      if (++half_periods == 0) first_s = time;
    }
    before = angle;
  }
  const double half_period_s = 0.5 * period_of_rod(0.4, M_PI / 3.0);
  EXPECT_NEAR(last_s - first_s, half_periods * half_period_s, 2.0 * dt + 1e-4 * most_s);
  EXPECT_NEAR((bench.energy() - start) / scale, 0.0, 2e-3);
}

TEST_P(JointOfEngine, ADoublePendulumKeepsItsEnergy) {
  Bench bench(GetParam(),
              "  - {name: upper, shape: box, size_m: [0.4, 0.02, 0.02], mass_kg: 0.2, position_m: [0.2, 0, 1]}\n"
              "  - {name: lower, shape: box, size_m: [0.36, 0.02, 0.02], mass_kg: 0.2, position_m: [0.58, 0, 1]}\n",
              "  - {name: pin, type: hinge, bodies: [upper, post], at_m: [0, 0, 1], axis: [0, 1, 0]}\n"
              "  - {name: elbow, type: ball, bodies: [lower, upper], at_m: [0.4, 0, 1]}\n");
  const double start = bench.energy(), scale = 0.2 * kG * 0.8;
  bench.run(fast() ? 20.0 : 4.0);
  EXPECT_NEAR((bench.energy() - start) / scale, 0.0, fast() ? 2000.0 * dt * dt : 2e-3);
}

TEST_P(JointOfEngine, ASliderOnASlopeAcceleratesAgainstItsFriction) {
  Bench bench(GetParam(),
              "  - {name: cart, shape: box, size_m: [0.1, 0.05, 0.02], mass_kg: 0.5, position_m: [0, 0, 2]}\n",
              "  - {name: rail, type: slider, bodies: [cart, post], at_m: [0, 0.3, 1.5], "
              "axis: [0.8660254037844387, 0, 0.5], slide: {friction_n: 1}}\n");
  bench.run(1.0);
  const double a = 0.5 * kG - 1.0 / 0.5;
  EXPECT_NEAR(bench.slide(0) / (-0.5 * a), 1.0, 1.1 * dt);  // bodies move with the speed at the end of a step
  EXPECT_NEAR(bench.state("cart").linear_velocity.norm(), a, 1e-3 * a);
}

TEST_P(JointOfEngine, FrictionAndAMotorChangeTheSpeedOfAWheelEvenly) {
  const std::string wheel = "shape: cylinder, radius_m: 0.1, length_m: 0.02, mass_kg: 1, ";
  Bench bench(GetParam(),
              "  - {name: braked, " + wheel + "position_m: [0, 0, 1.3], angular_velocity_rad_s: [0, 0, 10]}\n" +
                  "  - {name: driven, " + wheel + "position_m: [0, 1, 1.3]}\n",
              "  - {name: brake, type: hinge, bodies: [braked, post], at_m: [0, 0, 1.2], axis: [0, 0, 1], "
              "turn: {friction_n_m: 0.02}}\n"
              "  - {name: motor, type: hinge, bodies: [driven, post], at_m: [0, 1, 1.2], axis: [0, 0, 1], "
              "turn: {speed_rad_s: 6, torque_limit_n_m: 0.02}}\n");
  const auto speed = [&](const char* name) { return bench.state(name).angular_velocity.z(); };
  bench.run(1.0);  // moment of inertia 0.005 kg m^2: by 4 rad/s
  EXPECT_NEAR(speed("braked"), 6.0, 4e-3);
  EXPECT_NEAR(speed("driven"), 4.0, 4e-3);
  EXPECT_NEAR(bench.engine->joint_loads()[1].turn.z(), 0.02 * dt, 1e-4 * dt);
  EXPECT_NEAR(bench.engine->joint_loads()[1].motor_j, 0.02 * dt * 4.0, 1e-3 * dt);
  bench.run(2.0);
  EXPECT_NEAR(speed("braked"), 0.0, 1e-9);
  EXPECT_NEAR(speed("driven"), 6.0, 1e-4);
}

TEST_P(JointOfEngine, ASpringOscillatesAndALimitStops) {
  Bench bench(GetParam(),
              "  - {name: cart, shape: box, size_m: [0.1, 0.05, 0.02], mass_kg: 0.5, position_m: [0, 0, 2], "
              "gravity: false}\n"
              "  - {name: lid, shape: box, size_m: [0.2, 0.2, 0.01], mass_kg: 0.3, position_m: [0.1, 1, 1]}\n",
              "  - {name: rail, type: slider, bodies: [cart, post], at_m: [0, 0, 2], axis: [1, 0, 0], "
              "slide: {stiffness_n_m: 50, rest_m: 0.1}}\n"
              "  - {name: lid, type: hinge, bodies: [lid, post], at_m: [0, 1, 1], axis: [0, 1, 0], "
              "turn: {limits_deg: [-90, 40]}}\n");
  EXPECT_NEAR(spring_energy(bench.scene.joints[0], pose_of(bench.state("cart")), pose_of(bench.state("post"))),
              0.5 * 50 * 0.01, 1e-6);
  double most = 0.0;
  bench.run(2.0, [&] { most = std::max(most, bench.slide(0)); });
  EXPECT_NEAR(bench.slide(0), 0.1 - 0.1 * std::cos(20.0), 0.6 * dt + 1e-4);  // half a step ahead, at most 1 m/s
  EXPECT_NEAR(most, 0.2, 1e-4);
  EXPECT_NEAR(bench.turn(1), 40.0 * M_PI / 180.0, 1e-5);
  EXPECT_LT(bench.state("lid").angular_velocity.norm(), 1e-3);
  const double weight_n_m = 0.3 * kG * 0.1 * std::cos(40.0 * M_PI / 180.0);
  EXPECT_NEAR(bench.engine->joint_loads()[1].turn.y(), -weight_n_m * dt, 1e-3 * weight_n_m * dt);
}

TEST_P(JointOfEngine, ChainsAndBeamsCarryTenTimesTheirWeight) {
  Bench bench(GetParam(),
              "  - {name: link, shape: box, size_m: [0.01, 0.01, 0.05], mass_kg: 0.02, position_m: [0, 0, 0.975], "
              "repeat: {row: {count: 30, step_m: [0, 0, -0.05]}}}\n"
              "  - {name: beam, shape: box, size_m: [0.2, 0.02, 0.02], mass_kg: 0.2, position_m: [0.11, 1, 1], "
              "repeat: {row: {count: 3, step_m: [0.2, 0, 0]}}}\n",
              "  - {name: first, type: ball, bodies: [link/0, post], at_m: [0, 0, 1]}\n"
              "  - {name: pin, type: ball, between: link}\n"
              "  - {name: root, type: fixed, bodies: [beam/0, post], at_m: [0.01, 1, 1]}\n"
              "  - {name: weld, type: fixed, between: beam}\n");
  const double load_n = 10.0 * 0.6 * kG;
  bench.run(1.0, [&] {
    bench.engine->apply_force(bench.id("link/29"), {0, 0, -load_n}, {0, 0, 0});
    bench.engine->apply_force(bench.id("beam/2"), {0, 0, -load_n}, {0, 0, 0});
  });
  const auto loads = bench.engine->joint_loads();
  const std::size_t root = 30;
  EXPECT_NEAR(loads[0].impulse.z() / dt, load_n + 0.6 * kG, 1e-2);
  EXPECT_NEAR(loads[root].impulse.z() / dt, load_n + 0.6 * kG, 1e-2);
  EXPECT_NEAR(loads[root].turn.y() / dt, -(load_n * 0.5 + 0.6 * kG * 0.3), 1e-2);
}

// No position is nearer to a fit than this one, so that the joints have nothing to aim at.
TEST_P(JointOfEngine, ATautChainRests) {
  Bench bench(GetParam(),
              "  - {name: end, shape: box, size_m: [0.02, 0.02, 0.02], fixed: true, position_m: [1, 0, 1]}\n"
              "  - {name: plank, shape: box, size_m: [0.09, 0.2, 0.02], mass_kg: 0.2, position_m: [0.05, 0, 1], "
              "collision_group: bridge, repeat: {row: {count: 10, step_m: [0.1, 0, 0]}}}\n",
              "  - {name: first, type: hinge, bodies: [plank/0, post], at_m: [0, 0, 1], axis: [0, 1, 0]}\n"
              "  - {name: pin, type: ball, between: plank, turns: {friction_n_m: 0.001}}\n"
              "  - {name: last, type: hinge, bodies: [plank/9, end], at_m: [1, 0, 1], axis: [0, 1, 0]}\n");
  const double start = bench.energy();
  for (int i = 0; i < 10; ++i) {
    // As a correction by another copy of the world does.
    BodyState moved = bench.state("plank/4");
    moved.position.x() += 2e-5;
    bench.engine->set_state(bench.id("plank/4"), moved);
    bench.run(0.2);
    EXPECT_LT(bench.energy() - start, 5e-3) << i;
    bench.off_m = 0.0;
  }
  EXPECT_NEAR(bench.state("plank/4").position.z(), 1.0, 0.02);
}

TEST_P(JointOfEngine, AFourBarLoopFollowsItsClosedSolution) {
  const double ground = 0.35, crank = 0.1, coupler = 0.3, rocker = 0.25;
  const auto pins_at = [&](double angle) {
    const Vec3 p(crank * std::cos(angle), 0, crank * std::sin(angle));
    const Vec3 to = Vec3(ground, 0, 0) - p;
    const double d = to.norm(), along = (coupler * coupler - rocker * rocker + d * d) / (2 * d);
    const Vec3 e = to / d, across(-e.z(), 0, e.x());
    return std::pair{p, Vec3(p + along * e + std::sqrt(coupler * coupler - along * along) * across)};
  };
  const auto [p, q] = pins_at(M_PI / 2);
  const auto rod = [](std::string_view name, const Vec3& from, const Vec3& to) {
    const Vec3 mid = 0.5 * (from + to), d = to - from;
    return fmt::format(
        "  - {{name: {}, shape: box, size_m: [{}, 0.02, 0.02], mass_kg: 0.2, gravity: false, "
        "position_m: [{}, 0, {}], rotation: {{axis: [0, 1, 0], angle_deg: {}}}}}\n",
        name, d.norm(), mid.x(), mid.z(), -std::atan2(d.z(), d.x()) * 180 / M_PI);
  };
  const auto pin = [](std::string_view name, std::string_view bodies, const Vec3& at, const char* more) {
    return fmt::format("  - {{name: {}, type: hinge, bodies: [{}], at_m: [{}, 0, {}], axis: [0, -1, 0]{}}}\n", name,
                       bodies, at.x(), at.z(), more);
  };
  Bench bench(GetParam(), rod("crank", {0, 0, 0}, p) + rod("coupler", p, q) + rod("rocker", {ground, 0, 0}, q),
              pin("drive", "crank, post", {0, 0, 0}, ", turn: {speed_rad_s: 6, torque_limit_n_m: 10}") +
                  pin("a", "coupler, crank", p, "") + pin("b", "rocker, coupler", q, "") +
                  pin("c", "rocker, post", {ground, 0, 0}, ""));
  double most = 0.0;
  bench.run(
      3.0, [&] { most = std::max(most, (bench.place_at(2).point - pins_at(M_PI / 2 + bench.turn(0)).second).norm()); });
  EXPECT_LT(most, 5e-5);
  EXPECT_NEAR(std::remainder(bench.turn(0) - 18.0, 2 * M_PI), 0.0, 6.0 * dt + 1e-3);
}

TEST_P(JointOfEngine, GearsOnHingesTransmitByTheirTeeth) {
  // Twelve teeth each; the second turns the other way.
  const auto gear = [](std::string_view name, double x, double angle) {
    std::string parts;
    for (int i = 0; i < 6; ++i)
      parts += fmt::format("{}{{shape: box, size_m: [0.2, 0.02, 0.012], rotation: {{axis: [0, 1, 0], angle_deg: {}}}}}",
                           i == 0 ? "" : ", ", angle + 30 * i);
    return fmt::format("  - {{name: {}, shape: compound, mass_kg: 0.2, position_m: [{}, 0, 2], parts: [{}]}}\n", name,
                       x, parts);
  };
  Bench bench(GetParam(), gear("driver", 0, 0) + gear("driven", 0.17, 15),
              "  - {name: motor, type: hinge, bodies: [driver, post], at_m: [0, 0, 2], axis: [0, 1, 0], "
              "turn: {speed_rad_s: 3, torque_limit_n_m: 5}}\n"
              "  - {name: load, type: hinge, bodies: [driven, post], at_m: [0.17, 0, 2], axis: [0, 1, 0], "
              "turn: {friction_n_m: 0.1}}\n");
  std::array<double, 2> turned{}, before{};
  bench.run(4.0, [&] {
    for (std::size_t i = 0; i < 2; ++i) {
      turned[i] += std::remainder(bench.turn(i) - before[i], 2 * M_PI);
      before[i] = bench.turn(i);
    }
  });
  EXPECT_GT(turned[0], 9.0);                // radial teeth hit each other now and then
  EXPECT_NEAR(turned[1], -turned[0], 0.3);  // the play between teeth
}

TEST_P(JointOfEngine, UniversalPlanarAndCylindricalJointsLeaveTheirWaysFree) {
  Bench bench(GetParam(),
              "  - {name: fork, shape: box, size_m: [0.1, 0.04, 0.04], mass_kg: 0.2, position_m: [0.1, 0, 1], "
              "angular_velocity_rad_s: [2, 3, 4], gravity: false}\n"
              "  - {name: puck, shape: cylinder, radius_m: 0.05, length_m: 0.02, mass_kg: 0.2, position_m: [0, 1, 1], "
              "velocity_m_s: [1, 0.5, 0.3], angular_velocity_rad_s: [2, 0, 5]}\n"
              "  - {name: bolt, shape: cylinder, radius_m: 0.01, length_m: 0.1, mass_kg: 0.1, position_m: [0, 2, 1], "
              "velocity_m_s: [0, 0.5, 0], angular_velocity_rad_s: [1, 1, 7], gravity: false}\n",
              "  - {name: cardan, type: universal, bodies: [fork, post], at_m: [0, 0, 1], axis: [0, 0, 1], "
              "second_axis: [0, 1, 0]}\n"
              "  - {name: table, type: planar, bodies: [puck, post], at_m: [0, 1, 1], axis: [0, 0, 1], "
              "slides: {friction_n: 0.1}}\n"
              "  - {name: bore, type: cylindrical, bodies: [bolt, post], at_m: [0, 2, 1], axis: [0, 0, 1], "
              "slide: {speed_m_s: 0.2, force_limit_n: 5}}\n");
  bench.run(0.5);
  const JointPlace cardan = bench.place_at(0);
  EXPECT_GT(std::abs(cardan.coordinates[3]), 0.1);
  EXPECT_GT(std::abs(cardan.coordinates[4]), 0.1);
  // Friction of 0.5 m/s^2 against the motion, in no matter which direction.
  const double left = std::hypot(1.0, 0.5) - 0.5 * 0.5;
  EXPECT_NEAR(bench.state("puck").linear_velocity.norm(), left, 5e-3);
  EXPECT_NEAR(bench.state("puck").angular_velocity.z(), 5.0, 1e-2);
  EXPECT_NEAR(bench.slide(2), 0.1, 1e-3);
  EXPECT_NEAR(bench.state("bolt").angular_velocity.z(), 7.0, 1e-2);
}

TEST_P(JointOfEngine, BodiesThatDoNotRotateAndHeavyOnLightHold) {
  Bench bench(
      GetParam(),
      "  - {name: slide, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2, position_m: [0.2, 0, 1], rotates: false}\n"
      "  - {name: stiff, shape: sphere, radius_m: 0.02, mass_kg: 0.2, position_m: [0, 1, 1], rotates: false}\n"
      "  - {name: wire, shape: sphere, radius_m: 0.005, mass_kg: 0.001, position_m: [0, 2, 1]}\n"
      "  - {name: ball, shape: sphere, radius_m: 0.1, mass_kg: 50, position_m: [0, 2, 0.8]}\n",
      "  - {name: rail, type: slider, bodies: [slide, post], at_m: [0.2, 0, 1], axis: [0, 0, 1], "
      "slide: {friction_n: 1}}\n"
      "  - {name: weld, type: fixed, bodies: [stiff, post]}\n"
      "  - {name: eye, type: ball, bodies: [wire, post], at_m: [0, 2, 1.1], turns: {friction_n_m: 0.001}}\n"
      "  - {name: hook, type: ball, bodies: [ball, wire], at_m: [0, 2, 0.9]}\n");
  bench.run(0.5);
  EXPECT_NEAR(bench.state("slide").linear_velocity.z(), -(kG - 5.0) * 0.5, 0.01);
  EXPECT_LT(bench.state("stiff").linear_velocity.norm(), 1e-6);
  EXPECT_NEAR(bench.engine->joint_loads()[2].impulse.z(), 50.001 * kG * dt, 1e-3 * 50 * kG * dt);
}

TEST_P(JointOfEngine, ABrokenJointActsNoMoreAndAJointActsWhileBothBodiesAreThere) {
  Bench bench(GetParam(), "  - {name: ball, shape: sphere, radius_m: 0.02, mass_kg: 0.1, position_m: [0, 0, 0.9]}\n",
              "  - {name: wire, type: ball, bodies: [ball, post], at_m: [0, 0, 1]}\n");
  const BodyId ball = bench.id("ball");
  const auto is_joint = [](const Contact& c) { return c.is_joint(); };
  bench.run(0.1);
  EXPECT_EQ(std::ranges::count_if(bench.engine->contacts(), is_joint), 1);
  EXPECT_NEAR(bench.engine->contacts()[0].tangential_impulse.z(), -0.1 * kG * dt, 1e-4 * dt);  // on the post
  bench.engine->remove(bench.id("post"));
  bench.broken = 0;
  bench.run(0.1);
  EXPECT_TRUE(bench.engine->contacts().empty());
  EXPECT_NEAR(bench.engine->state(ball).linear_velocity.z(), -0.1 * kG, 1e-3);
  bench.engine->add(bench.scene.body(bench.id("post")), bench.scene.initial[index(bench.id("post"))]);
  bench.engine->set_state(ball, bench.scene.initial[index(ball)]);
  bench.run(0.1);
  EXPECT_NEAR(bench.engine->state(ball).position.z(), 0.9, 1e-6);
  bench.engine->remove(ball);
  bench.engine->add(bench.scene.body(ball), bench.scene.initial[index(ball)], Role::ghost);
  bench.run(dt);
  EXPECT_TRUE(bench.engine->contacts().empty());
  bench.engine->remove(ball);
  bench.engine->add(bench.scene.body(ball), bench.scene.initial[index(ball)]);
  bench.run(dt);
  EXPECT_EQ(bench.engine->contacts().size(), 1U);
  bench.engine->break_joint(0);
  bench.run(0.1);
  EXPECT_NEAR(bench.engine->state(ball).linear_velocity.z(), -0.1 * kG, 1e-3);
}

TEST_P(JointOfEngine, AnotherUnitOfLengthChangesNothing) {
  test::Tested tested = GetParam();
  const auto end = [&](double unit_m) {
    const std::string bodies =
        "  - {name: arm, shape: box, size_m: [0.04, 0.01, 0.01], mass_kg: 0.02, position_m: [0.02, 0, 1]}\n"
        "  - {name: cart, shape: box, size_m: [0.02, 0.02, 0.02], mass_kg: 0.02, position_m: [0, 1, 1]}\n";
    const std::string joints =
        "  - {name: pin, type: hinge, bodies: [arm, post], at_m: [0, 0, 1], axis: [0, 1, 0], "
        "turn: {stiffness_n_m_rad: 0.01, damping_n_m_s: 0.0001, friction_n_m: 0.0005}}\n"
        "  - {name: rail, type: slider, bodies: [cart, post], at_m: [0, 1, 1], axis: [0, 0, 1], "
        "slide: {stiffness_n_m: 20, friction_n: 0.05, limits_m: [-0.01, 0.01]}}\n";
    Bench bench(tested, bodies, joints);
    EngineSettings settings = tested.settings();
    settings.length_unit_m = unit_m;
    bench.engine = make_engine(settings, {});
    bench.engine->set_joints(bench.scene.joints);
    for (const Body& body : bench.scene.bodies) bench.engine->add(body, bench.scene.initial[index(body.id)]);
    bench.run(0.2);
    return std::array{bench.turn(0), bench.slide(1), bench.engine->joint_loads()[0].impulse.z() / dt,
                      bench.engine->joint_loads()[0].turn.y() / dt};
  };
  const auto metres = end(1.0), millimetres = end(1e-3);
  const double part = tested.engine == "bullet" ? 2e-4 : 5e-3;
  for (std::size_t i = 0; i < metres.size(); ++i)
    EXPECT_NEAR(metres[i], millimetres[i], part * std::abs(metres[i])) << i;
}

test::Halves<test::Tested> engines_with_joints() {
  std::vector<test::Tested> all;
  for (const char* engine : {"bullet", "bullet_float"}) {
    for (const char* preset : {"fast", "quality"}) all.push_back({engine, preset, 0.001});
    all.push_back({engine, "quality", 0.004});
  }
  return test::halves(all, 3);
}
INSTANTIATE_TEST_SUITE_P(Engines, JointOfEngine, testing::ValuesIn(engines_with_joints().half), test::name_of);
INSTANTIATE_TEST_SUITE_P(Full, JointOfEngine, testing::ValuesIn(engines_with_joints().other), test::name_of);

class FastJointOfEngine : public JointOfEngine {};
TEST_P(FastJointOfEngine, AChainHangsInItsCatenary) {
  // Thirty rods of 50 mm between ends 1.2 m apart: rod i has the slope (i - 14.5) w / H.
  Bench bench(GetParam(),
              "  - {name: end, shape: box, size_m: [0.02, 0.02, 0.02], mass_kg: 1, position_m: [1.53, 0, 1], "
              "gravity: false}\n"
              "  - {name: link, shape: box, size_m: [0.05, 0.01, 0.01], mass_kg: 0.02, position_m: [0.025, 0, 1], "
              "repeat: {row: {count: 30, step_m: [0.05, 0, 0]}}}\n",
              "  - {name: first, type: ball, bodies: [link/0, post], at_m: [0, 0, 1], turns: {damping_n_m_s: 0.005}}\n"
              "  - {name: pin, type: ball, between: link, turns: {damping_n_m_s: 0.005}}\n"
              "  - {name: last, type: ball, bodies: [link/29, end], at_m: [1.5, 0, 1], turns: {damping_n_m_s: 0.005}}\n"
              "  - {name: rail, type: slider, bodies: [end, post], at_m: [1.5, 0, 1], axis: [1, 0, 0], "
              "slide: {speed_m_s: -0.3, force_limit_n: 100, limits_m: [-0.3, 0]}}\n");
  bench.run(10.0);
  EXPECT_NEAR(bench.state("end").position.x(), 1.23, 1e-4);
  EXPECT_NEAR(bench.state("link/15").position.z(), 0.60284, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Engines, FastJointOfEngine, testing::Values(test::Tested{"bullet_float", "fast"}),
                         test::name_of);
INSTANTIATE_TEST_SUITE_P(Full, FastJointOfEngine, testing::Values(test::Tested{"bullet", "fast"}), test::name_of);

TEST(JointOfEngines, BodiesOfOneGroupOverlapAndThoseOfTwoDoNot) {
  for (const char* name : {"bullet", "bullet_float", "ode"}) {
    const auto engine = test::Tested{name, "fast"}.make();
    const auto add = [&](BodyId id, double x, std::uint32_t group) {
      Body body = test::cube(id);
      body.gravity = false;
      body.group = group;
      engine->add(body, test::at(x, 0, 0));
    };
    add(BodyId{1}, 0.0, 1);
    add(BodyId{2}, 0.05, 1);
    test::run(*engine, 50, 0.001);
    EXPECT_TRUE(engine->contacts().empty()) << name;
    EXPECT_NEAR(engine->state(BodyId{2}).position.x(), 0.05, 1e-8) << name;
    engine->remove(BodyId{2});
    add(BodyId{2}, 0.05, 2);
    test::run(*engine, 1, 0.001);
    EXPECT_FALSE(engine->contacts().empty()) << name;
  }
}

TEST(JointOfEngines, ABrokenOneStaysBrokenInTheNextEngine) {
  const test::Tested tested{"bullet", "fast"};
  Bench bench(tested, "  - {name: ball, shape: sphere, radius_m: 0.02, mass_kg: 0.1, position_m: [0, 0, 0.9]}\n",
              "  - {name: wire, type: ball, bodies: [ball, post], at_m: [0, 0, 1]}\n");
  LiveEngine live(tested.make());
  live.set_joints(bench.scene.joints);
  for (const Body& body : bench.scene.bodies) live.add(body, bench.scene.initial[index(body.id)]);
  live.break_joint(0);
  (void)live.exchange(prepare_engine({.name = "bullet_float"}, {}, live.content(), 0.0, bench.scene.joints));
  test::run(live, 100, 0.001);
  EXPECT_NEAR(live.state(bench.id("ball")).linear_velocity.z(), -0.1 * kG, 1e-3);
}

TEST(JointOfEngines, WithoutJointsRefusesThemAndNamesThoseThatHaveThem) {
  Joint joint;
  joint.b = BodyId{1};
  for (const std::string& name : engine_names()) {
    if (name.starts_with("bullet")) continue;
    const auto engine = test::Tested{name, "fast"}.make();
    engine->set_joints({});
    try {
      engine->set_joints({&joint, 1});
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()), name + " has no joints; use bullet or bullet_float");
    }
  }
}

}  // namespace
}  // namespace subworld
