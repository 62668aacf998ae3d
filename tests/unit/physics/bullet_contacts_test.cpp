// Exact contacts that are computed again in each step, and the look ahead, in Bullet.

#include "common/physics/bullet/contacts/corners.hpp"
#include "model/shapes/mass_properties.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace subworld {
namespace {

using test::kBody;
using test::kFloor;
constexpr double kTable_m = 0.25;

Mesh slab_mesh(const Vec3& half) {
  Mesh mesh;
  mesh.file = "box";
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).cwiseProduct(half));
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

/// A prism with this number of sides, axis z.
Mesh prism(int sides, double radius, double half_length) {
  Mesh mesh;
  mesh.file = "prism";
  for (const double z : {-half_length, half_length}) {
    for (int i = 0; i < sides; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / sides;
      mesh.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
    }
  }
  return mesh;
}

enum MeshId : std::uint32_t { kTable, kWall, kPrism, kSmall, kCoin, kPlate };
const std::vector<Mesh>& bullet_meshes() {
  static const std::vector<Mesh> kAll{
      slab_mesh(Vec3(0.5, 0.5, kTable_m)), slab_mesh(Vec3(0.005, 0.2, 0.2)), prism(12, 0.05, 0.04),
      slab_mesh(Vec3::Constant(0.0025)),   prism(150, 0.05, 0.01),           prism(24, 0.1, 0.01)};
  return kAll;
}

Body body_of(BodyId id, const Shape& shape, double mass) {
  Body body;
  body.id = id;
  body.shape = shape;
  body.mass = mass;
  const Vec3 box = shape.kind == ShapeKind::box ? shape.half_extents : Vec3::Constant(0.05);
  const Shape solid = shape.kind == ShapeKind::convex ? Shape{.kind = ShapeKind::box, .half_extents = box} : shape;
  if (mass > 0.0) body.inertia = principal_inertia(solid, mass);
  return body;
}

struct Ground {
  std::string name;
  Shape shape;
};
std::vector<Ground> tables() {
  return {{"plane", {.kind = ShapeKind::plane}},
          {"box", {.kind = ShapeKind::box, .half_extents = Vec3(0.5, 0.5, kTable_m)}},
          {"mesh", {.kind = ShapeKind::mesh, .mesh = kTable}},
          {"hull", {.kind = ShapeKind::convex, .mesh = kTable}},
          {"disc", {.kind = ShapeKind::cylinder, .radius = 0.5, .half_length = kTable_m}}};
}

BodyState state_at(const Vec3& position, const Quat& orientation = Quat::Identity()) {
  BodyState state;
  state.position = position;
  state.orientation = orientation;
  return state;
}

const Quat kLying(Eigen::AngleAxisd(0.5 * std::numbers::pi, Vec3::UnitX()));
const Shape kCylinder{.kind = ShapeKind::cylinder, .radius = 0.05, .half_length = 0.05};
const Shape kCapsule{.kind = ShapeKind::capsule, .radius = 0.05, .half_length = 0.05};

class BulletContacts : public testing::TestWithParam<test::Tested> {
 protected:
  /// A world with a table whose top is 0.5 m high, or with a plane at that height.
  std::unique_ptr<Engine> on_table(const Shape& table, const Body& body, const BodyState& from_top) {
    auto engine = GetParam().make(bullet_meshes());
    const double top = table.kind == ShapeKind::plane ? 0.0 : 2.0 * kTable_m;
    engine->add(body_of(kFloor, table, 0.0), state_at(Vec3(0, 0, table.kind == ShapeKind::plane ? 0.0 : kTable_m)));
    BodyState start = from_top;
    start.position.z() += top;
    engine->add(body, start);
    return engine;
  }
};

TEST_P(BulletContacts, RoundBodiesStayWhereTheyLie) {
  for (const Ground& table : tables()) {
    for (const Shape& shape : {kCylinder, kCapsule}) {
      SCOPED_TRACE(table.name + (shape.kind == ShapeKind::capsule ? ", capsule" : ", cylinder"));
      const Quat turned = Eigen::AngleAxisd(0.4, Vec3::UnitZ()) * kLying;
      const auto engine = on_table(table.shape, body_of(kBody, shape, 1.0), state_at(Vec3(0.013, 0.007, 0.05), turned));
      const BodyState start = engine->state(kBody);
      test::run(*engine, GetParam().steps(5.0), GetParam().dt);
      const BodyState end = engine->state(kBody);
      EXPECT_LT((end.position - start.position).norm(), 5.0 * 1e-4);  // 0.1 mm/s
      EXPECT_LT(end.linear_velocity.norm(), 1e-4);
      EXPECT_LT(end.angular_velocity.norm(), 2e-3);
    }
  }
}

TEST_P(BulletContacts, AnOverhangingCylinderLiesStill) {
  const auto engine = on_table(tables()[1].shape,
                               body_of(kBody, {.kind = ShapeKind::cylinder, .radius = 0.05, .half_length = 0.1}, 1.0),
                               state_at(Vec3(0.1, 0.46, 0.05), kLying));
  test::run(*engine, GetParam().steps(3.0), GetParam().dt);
  EXPECT_LT((engine->state(kBody).position - Vec3(0.1, 0.46, 0.55)).norm(), 3e-4);
}

/// Two equal hulls on a plane, one rotated on the other; returns the time of 300 steps, s.
double stack_of_two(const test::Tested& tested, MeshId mesh, double half_height) {
  const auto engine = tested.make(bullet_meshes());
  const Shape hull{.kind = ShapeKind::convex, .mesh = mesh};
  engine->add(body_of(kFloor, {.kind = ShapeKind::plane}, 0.0), BodyState{});
  const Quat turned(Eigen::AngleAxisd(0.05, Vec3::UnitZ()));
  engine->add(body_of(kBody, hull, 1.0), state_at(Vec3(0, 0, half_height)));
  engine->add(body_of(BodyId{2}, hull, 1.0), state_at(Vec3(0, 0, 3.0 * half_height), turned));
  const auto begin = std::chrono::steady_clock::now();
  test::run(*engine, 300, tested.dt);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_LT((engine->state(BodyId{2}).position - Vec3(0, 0, 3.0 * half_height)).norm(), 1e-4);
  EXPECT_LT(engine->state(BodyId{2}).orientation.angularDistance(turned), 1e-3);
  return took.count();
}

// A face of 150 corners touches all around, and the cost does not grow with the number of combinations.
TEST_P(BulletContacts, FacesOfManyCornersRestAndCostLittle) {
  std::vector<double> ratios;
  for (int i = 0; i < 5; ++i)
    ratios.push_back(stack_of_two(GetParam(), kCoin, 0.01) / stack_of_two(GetParam(), kPrism, 0.04));
  std::ranges::sort(ratios);
  EXPECT_LT(ratios[2], 15.0);
  RecordProperty("cost_ratio", std::to_string(ratios[2]));
}

// The intersection of the plate's face with the coin's has more corners than the capacity.
TEST_P(BulletContacts, APlateRestsOnACoinOfManyCorners) {
  const auto engine = GetParam().make(bullet_meshes());
  engine->add(body_of(kFloor, {.kind = ShapeKind::convex, .mesh = kCoin}, 0.0), BodyState{});
  const Vec3 at(0.046, 0, 0.02);  // just inside the coin's edge
  engine->add(body_of(kBody, {.kind = ShapeKind::convex, .mesh = kPlate}, 1.0), state_at(at));
  for (double angle = 0.0; angle < 6.2; angle += 0.4) {
    const Vec3 turned = Eigen::AngleAxisd(angle, Vec3::UnitZ()) * at;
    engine->set_state(kBody, state_at(turned));
    test::run(*engine, GetParam().steps(0.3), GetParam().dt);
    EXPECT_LT((engine->state(kBody).position - turned).norm(), 2e-4) << angle;
    EXPECT_LT(engine->state(kBody).orientation.angularDistance(Quat::Identity()), 0.03)
        << angle << ": four points follow it as it leans";
  }
}

TEST(BulletCorners, GoAllAroundWhereThereIsNoRoomForAll) {
  bullet::Corners corners;
  const auto on_circle = [](int i) {
    const double angle = 2.0 * std::numbers::pi * i / 200;
    return Vec3(std::cos(angle), std::sin(angle), 0.0);
  };
  for (int i = 0; i < 200; ++i) corners.add({on_circle(i), i, i});
  for (int i = 0; i < 200; ++i) {
    double nearest = 2.0;
    for (const bullet::Corner& c : corners) nearest = std::min(nearest, (c.point - on_circle(i)).norm());
    EXPECT_LT(nearest, 0.15) << i;
  }
}

// A torque rolls a ball without slip: a = (t / r) / (m + I / r^2).
TEST_P(BulletContacts, ATorqueRollsABall) {
  const Shape ball{.kind = ShapeKind::sphere, .radius = 0.05};
  const auto engine = on_table(tables()[0].shape, body_of(kBody, ball, 1.0), state_at(Vec3(0, 0, 0.05)));
  test::run(*engine, GetParam().steps(0.2), GetParam().dt);
  const double torque = 0.05, seconds = 0.5;
  for (int i = 0; i < GetParam().steps(seconds); ++i) {
    engine->apply_force(kBody, Vec3::Zero(), Vec3(0, torque, 0));
    engine->step(GetParam().dt);
  }
  const double expected = seconds * (torque / 0.05) / (1.0 + 0.4);
  EXPECT_NEAR(engine->state(kBody).linear_velocity.x(), expected, 0.01 * expected);
  EXPECT_NEAR(engine->state(kBody).angular_velocity.y(), expected / 0.05, 0.01 * expected / 0.05);
}

// Friction holds a cube against a torque about the vertical of half the limit.
TEST_P(BulletContacts, ATorqueBelowFrictionTurnsNothing) {
  const Shape cube{.kind = ShapeKind::box, .half_extents = Vec3::Constant(0.05)};
  const auto engine = on_table(tables()[0].shape, body_of(kBody, cube, 1.0), state_at(Vec3(0, 0, 0.05)));
  test::run(*engine, GetParam().steps(0.2), GetParam().dt);
  const double torque = 0.5 * 0.5 * test::kG * 0.05 * std::numbers::sqrt2;
  for (int i = 0; i < GetParam().steps(1.0); ++i) {
    engine->apply_force(kBody, Vec3::Zero(), Vec3(0, 0, torque));
    engine->step(GetParam().dt);
  }
  EXPECT_LT(engine->state(kBody).orientation.angularDistance(Quat::Identity()), 2e-3);
}

TEST_P(BulletContacts, ARollingBodyKeepsItsSpeed) {
  for (const Ground& table : tables()) {
    for (const Shape& shape : {kCylinder, kCapsule}) {
      for (const double speed : {0.1, 0.3}) {
        SCOPED_TRACE(table.name + (shape.kind == ShapeKind::capsule ? ", capsule" : ", cylinder"));
        BodyState start = state_at(Vec3(-0.2, 0.007, 0.05), kLying);
        start.linear_velocity.x() = speed;
        start.angular_velocity.y() = speed / 0.05;
        const auto engine = on_table(table.shape, body_of(kBody, shape, 1.0), start);
        test::run(*engine, GetParam().steps(1.0), GetParam().dt);
        EXPECT_NEAR(engine->state(kBody).linear_velocity.x(), speed, 0.02 * speed);
        EXPECT_NEAR(engine->state(kBody).position.x(), speed - 0.2, 0.02 * speed);
        EXPECT_NEAR(engine->state(kBody).position.y(), 0.007, 1e-3);
      }
    }
  }
}

TEST_P(BulletContacts, HullsAreAsLargeAsTheirVerticesSay) {
  const Shape hull{.kind = ShapeKind::convex, .mesh = kPrism}, ball{.kind = ShapeKind::sphere, .radius = 0.02};
  const double apothem = 0.05 * std::cos(std::numbers::pi / 12.0);
  const Quat on_side = Eigen::AngleAxisd(0.5 * std::numbers::pi, Vec3::UnitX()) *
                       Eigen::AngleAxisd(std::numbers::pi / 12.0, Vec3::UnitZ());
  for (const Ground& table : tables()) {
    SCOPED_TRACE(table.name);
    for (const bool lies : {false, true}) {
      const double height = lies ? apothem : 0.04;
      const auto engine = on_table(table.shape, body_of(kBody, hull, 1.0),
                                   state_at(Vec3(0.1, 0.05, height), lies ? on_side : Quat::Identity()));
      const Vec3 start = engine->state(kBody).position;
      BodyState above = engine->state(kBody);
      above.position += Vec3(0, 0, height + 0.02);
      above.orientation = Quat::Identity();
      engine->add(body_of(BodyId{2}, ball, 0.1), above);
      test::run(*engine, GetParam().steps(1.0), GetParam().dt);
      const double room = 1e-3 * height + 2e-5;  // depth at which engines let contacts rest
      EXPECT_LT((engine->state(kBody).position - start).norm(), room);
      EXPECT_NEAR(engine->state(BodyId{2}).position.z() - start.z(), height + 0.02, room);
    }
  }
}

TEST_P(BulletContacts, HullsStackExactly) {
  const Shape hull{.kind = ShapeKind::convex, .mesh = kPrism};
  const auto engine = on_table(tables()[1].shape, body_of(kBody, hull, 1.0), state_at(Vec3(0, 0, 0.04)));
  for (int i = 1; i < 5; ++i) {
    const Quat turned(Eigen::AngleAxisd(0.1 * i, Vec3::UnitZ()));
    engine->add(body_of(BodyId(i + 1), hull, 1.0), state_at(Vec3(2e-3 * i, 0, 0.54 + 0.08 * i), turned));
  }
  test::run(*engine, GetParam().steps(2.0), GetParam().dt);
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(engine->state(BodyId(i + 1)).position.z(), 0.54 + 0.08 * i, 2e-4) << i;
    EXPECT_NEAR(engine->state(BodyId(i + 1)).position.x(), 2e-3 * i, 1e-3) << i;
  }
}

/// Pushes below mu N are held, and larger ones accelerate the body, also with unrealistically large mu.
TEST_P(BulletContacts, FrictionIsAsGiven) {
  for (const double mu : {0.2, 2.0, 20.0}) {
    SCOPED_TRACE(mu);
    for (const double push : {0.8, 1.3}) {
      Body plate = body_of(kBody, {.kind = ShapeKind::box, .half_extents = Vec3(1.0, 1.0, 0.002)}, 1.0);
      Body floor = body_of(kFloor, {.kind = ShapeKind::plane}, 0.0);
      plate.material.friction = floor.material.friction = mu;
      auto engine = GetParam().make();
      engine->add(floor, BodyState{});
      engine->add(plate, state_at(Vec3(0, 0, 0.002)));
      test::run(*engine, GetParam().steps(0.2), GetParam().dt);
      for (int i = 0; i < GetParam().steps(0.2); ++i) {
        engine->apply_force(kBody, push * mu * test::kG * Vec3::UnitX(), Vec3::Zero());
        engine->step(GetParam().dt);
      }
      const double expected = push < 1.0 ? 0.0 : (push - 1.0) * mu * test::kG * 0.2;
      EXPECT_NEAR(engine->state(kBody).linear_velocity.x(), expected, 0.02 * mu * test::kG * 0.2);
    }
  }
}

std::vector<Ground> shots() {
  return {{"sphere", {.kind = ShapeKind::sphere, .radius = 0.0025}},
          {"box", {.kind = ShapeKind::box, .half_extents = Vec3::Constant(0.0025)}},
          {"capsule", {.kind = ShapeKind::capsule, .radius = 0.002, .half_length = 0.002}},
          {"cylinder", {.kind = ShapeKind::cylinder, .radius = 0.0025, .half_length = 0.0025}},
          {"hull", {.kind = ShapeKind::convex, .mesh = kSmall}}};
}
std::vector<Ground> walls() {
  return {{"box", {.kind = ShapeKind::box, .half_extents = Vec3(0.005, 0.2, 0.2)}},
          {"mesh", {.kind = ShapeKind::mesh, .mesh = kWall}},
          {"hull", {.kind = ShapeKind::convex, .mesh = kWall}}};
}

/// A shot towards +x at a wall at x = 0.
struct Range {
  Range(const test::Tested& tested, const Shape& shot, const Shape& wall, double wall_kg, double speed, double ahead_m,
        double aside_m, double restitution = 0.0)
      : engine(tested.make(bullet_meshes())) {
    Body target = body_of(kFloor, wall, wall_kg), bullet = body_of(kBody, shot, 1e-3);
    target.gravity = bullet.gravity = false;
    target.material.restitution = bullet.material.restitution = std::sqrt(restitution);
    bullet.inertia = Vec3::Constant(1e-8);
    engine->add(target, BodyState{});
    BodyState start = state_at(Vec3(-0.05 - ahead_m, 0.011, aside_m));
    start.linear_velocity.x() = speed;
    engine->add(bullet, start);
    test::run(*engine, static_cast<int>((0.1 + ahead_m) / speed / tested.dt) + 10, tested.dt);
  }
  [[nodiscard]] BodyState shot() const { return engine->state(kBody); }
  std::unique_ptr<Engine> engine;
};

TEST_P(BulletContacts, NothingPassesAWall) {
  constexpr int kPhases = 8;
  const double speed = GetParam().dt > 0.002 ? 20.0 : 100.0;
  for (const Ground& shot : shots()) {
    for (const Ground& wall : walls()) {
      for (const double wall_kg : {0.0, 5.0}) {
        if (wall.shape.kind == ShapeKind::mesh && wall_kg > 0.0) continue;
        for (const double v : {speed, 0.1 * speed, 5.0 * speed}) {
          for (int phase = 0; phase < kPhases; ++phase) {
            SCOPED_TRACE(testing::Message()
                         << shot.name << " on " << wall.name << ", " << wall_kg << " kg, " << v << " m/s");
            const Range range(GetParam(), shot.shape, wall.shape, wall_kg, v, v * GetParam().dt * phase / kPhases,
                              0.007);
            EXPECT_LT(range.shot().position.x(), range.engine->state(kFloor).position.x() - 0.005);
            if (wall_kg == 0.0) continue;
            const double both = 1e-3 * v / (wall_kg + 1e-3);  // momentum
            EXPECT_NEAR(range.engine->state(kFloor).linear_velocity.x(), both, 0.02 * both);
          }
        }
      }
    }
  }
}

TEST_P(BulletContacts, AFastShotBouncesAsFast) {
  for (const Ground& wall : walls()) {
    SCOPED_TRACE(wall.name);
    const Range range(GetParam(), shots()[0].shape, wall.shape, 0.0, 50.0, 0.0, 0.007, 0.5);
    EXPECT_NEAR(range.shot().linear_velocity.x(), -25.0, 0.25);
  }
}

TEST_P(BulletContacts, AShotThatPassesByIsLeftAlone) {
  for (const Ground& shot : shots()) {
    for (const Ground& wall : walls()) {
      SCOPED_TRACE(shot.name + " by " + wall.name);
      const Range range(GetParam(), shot.shape, wall.shape, 0.0, 80.0, 0.0, 0.2 + 0.0055);
      EXPECT_NEAR(range.shot().linear_velocity.x(), 80.0, 1e-3);
      EXPECT_GT(range.shot().position.x(), 0.03);
    }
  }
}

TEST_P(BulletContacts, ALookAheadGivesEqualBits) {
  const auto run = [&] {
    const Range range(GetParam(), shots()[3].shape, walls()[2].shape, 5.0, 90.0, 0.01, 0.007);
    return test::bits(*range.engine, {kFloor, kBody});
  };
  EXPECT_EQ(run(), run());
}

test::Halves<test::Tested> bullets_in_contact() {
  std::vector<test::Tested> all = test::tested_engines({0.001, 0.004}, {0.001, 0.004});
  std::erase_if(all, [](const test::Tested& t) { return !t.engine.starts_with("bullet"); });
  return test::halves(all, 4);
}
INSTANTIATE_TEST_SUITE_P(Engines, BulletContacts, testing::ValuesIn(bullets_in_contact().half), test::name_of);
INSTANTIATE_TEST_SUITE_P(Full, BulletContacts, testing::ValuesIn(bullets_in_contact().other), test::name_of);

}  // namespace
}  // namespace subworld
