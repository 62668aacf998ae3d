#include "bench/large/large_world.hpp"

#include "model/scene/scene_layout.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/mass_properties.hpp"

#include <cmath>
#include <numbers>

namespace subworld::bench {

namespace {

constexpr double kCube_kg = 1000.0;

struct Builder {
  Scene scene;

  Body& add(const Shape& shape, double mass_kg, const Pose& pose) {
    Body body;
    body.id = BodyId{static_cast<std::uint32_t>(scene.bodies.size())};
    body.shape = shape;
    body.mass = mass_kg;
    if (mass_kg > 0.0) body.inertia = principal_inertia(shape, mass_kg);
    scene.bodies.push_back(body);
    scene.initial.emplace_back().position = pose.position;
    scene.initial.back().orientation = pose.orientation;
    return scene.bodies.back();
  }
  void add_box(const Vec3& half, double mass_kg, const Pose& pose) {
    add({.kind = ShapeKind::box, .half_extents = half}, mass_kg, pose);
  }
  /// Tilted cubes in layers.
  void add_cubes(int count, double side_m, const Vec3& from) {
    HeapLayout layout;
    layout.count = count;
    layout.area = {side_m, side_m};
    layout.seed = 1;
    layout.half_extents = Vec3::Constant(0.5);
    layout.bounding_radius = layout.half_extents.norm();
    layout.max_tilt_deg = 10.0;
    for (Pose place : lay_out(layout)) {
      place.position += from;
      add_box(layout.half_extents, kCube_kg, place);
    }
  }
};

void add_basin(Builder& to, int count) {
  constexpr double kHigh_m = 60.0, kThick_m = 2.0;
  const double side = 1.2 * std::cbrt(count);
  to.add({.kind = ShapeKind::plane}, 0.0, {});
  for (const double sign : {-1.0, 1.0}) {
    const double off = sign * 0.5 * (side + kThick_m), half = 0.5 * side + kThick_m;
    to.add_box({0.5 * kThick_m, half, 0.5 * kHigh_m}, 0.0, {Vec3(off, 0, 0.5 * kHigh_m), Quat::Identity()});
    to.add_box({half, 0.5 * kThick_m, 0.5 * kHigh_m}, 0.0, {Vec3(0, off, 0.5 * kHigh_m), Quat::Identity()});
  }
  to.add_cubes(count, side, Vec3(0, 0, 0.5));
}

/// Its axis is y. It is so heavy that the cubes do not slow it down.
void add_drum(Builder& to, int count) {
  constexpr int kSides = 8;
  constexpr double kThick_m = 1.0, kSpeed_rad_s = 0.4;
  const double cubes = 1.25 * std::cbrt(count), inner = 1.1 * cubes, half_length = 0.5 * cubes + 1.0;
  Mesh drum;
  for (int i = 0; i < kSides; ++i) {
    const Quat turn(Eigen::AngleAxisd(2.0 * std::numbers::pi * i / kSides, Vec3::UnitY()));
    const double half_width = (inner + kThick_m) * std::tan(std::numbers::pi / kSides);
    drum.parts.push_back({{.kind = ShapeKind::box, .half_extents = {half_width, half_length, 0.5 * kThick_m}},
                          {turn * Vec3(0, 0, inner + 0.5 * kThick_m), turn},
                          {}});
  }
  for (const double sign : {-1.0, 1.0})
    drum.parts.push_back({{.kind = ShapeKind::box, .half_extents = {1.2 * inner, 0.5 * kThick_m, 1.2 * inner}},
                          {Vec3(0, sign * (half_length + 0.5 * kThick_m), 0), Quat::Identity()},
                          {}});
  to.scene.meshes.push_back(drum);
  Body post;
  to.add_box(Vec3::Constant(0.1), 0.0, {Vec3(0, 0, -3.0 * inner), Quat::Identity()});
  const double mass = 100.0 * kCube_kg * count;
  to.add({.kind = ShapeKind::compound, .mesh = 0}, 0.0, {}).mass = mass;
  to.scene.bodies.back().inertia = Vec3::Constant(mass * inner * inner);
  to.scene.bodies.back().gravity = false;
  Joint axle{.name = "axle", .kind = JointKind::hinge, .a = BodyId{1}, .b = BodyId{0}};
  axle.in_b.position = Vec3(0, 0, 3.0 * inner);
  JointAxis& turn = axle.axes[4];
  turn.free = true;
  turn.damping = INFINITY;
  turn.speed = kSpeed_rad_s;
  turn.most = 1e4 * mass;
  to.scene.joints.push_back(axle);
  to.add_cubes(count, cubes, Vec3(0, 0, -0.5 * cubes));
}

void add_wall(Builder& to, int count) {
  const int across = static_cast<int>(std::lround(std::sqrt(2.0 * count))), high = count / across;
  to.add({.kind = ShapeKind::plane}, 0.0, {});
  for (int k = 0; k < high; ++k) {
    for (int i = 0; i < across; ++i) {
      const double x = (i - 0.5 * across) + (k % 2 == 0 ? 0.25 : -0.25);
      to.add_box({0.499, 0.5, 0.25}, 0.5 * kCube_kg, {Vec3(x, 0, 0.25 + 0.5 * k), Quat::Identity()});
    }
  }
  const double radius = 0.1 * high;
  to.add({.kind = ShapeKind::sphere, .radius = radius}, 2.0 * kCube_kg * std::pow(radius, 3),
         {Vec3(0, -3.0 * radius, 0.25 * high), Quat::Identity()});
  to.scene.initial.back().linear_velocity = Vec3(0, 30, 0);
}

}  // namespace

Scene large_world(std::string_view name, int count) {
  Builder builder;
  builder.scene.name = name;
  if (name == "basin") add_basin(builder, count);
  if (name == "drum") add_drum(builder, count);
  if (name == "wall") add_wall(builder, count);
  return builder.scene;
}

}  // namespace subworld::bench
