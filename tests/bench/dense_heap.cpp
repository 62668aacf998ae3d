#include "bench/dense_heap.hpp"

#include "model/scene/scene_layout.hpp"
#include "model/shapes/mass_properties.hpp"

#include <cmath>

namespace subworld::bench {

namespace {

constexpr double kCubeMass_kg = 0.2;

void add(HeapWorld& world, Body body, const Pose& pose) {
  body.id = BodyId{static_cast<std::uint32_t>(world.bodies.size())};
  world.bodies.push_back(body);
  world.states.emplace_back().position = pose.position;
  world.states.back().orientation = pose.orientation;
}

void add_box(HeapWorld& world, const Vec3& half, double mass_kg, const Pose& pose) {
  Body body;
  body.shape.kind = ShapeKind::box;
  body.shape.half_extents = half;
  body.mass = mass_kg;
  if (mass_kg > 0.0) body.inertia = principal_inertia(body.shape, mass_kg);
  add(world, body, pose);
}

}  // namespace

HeapWorld dense_heap(int cubes) {
  HeapWorld world;
  Body floor;
  floor.shape.kind = ShapeKind::plane;
  add(world, floor, {});
  const double side = 1.3 * kHeapCubeSide_m * std::cbrt(cubes);
  constexpr double kWall = 0.1, kHeight = 3.0;
  for (const double sign : {-1.0, 1.0}) {
    const double off = sign * 0.5 * (side + kWall), half = 0.5 * side + kWall;
    add_box(world, {0.5 * kWall, half, 0.5 * kHeight}, 0.0, {Vec3(off, 0, 0.5 * kHeight), Quat::Identity()});
    add_box(world, {half, 0.5 * kWall, 0.5 * kHeight}, 0.0, {Vec3(0, off, 0.5 * kHeight), Quat::Identity()});
  }
  HeapLayout layout;
  layout.count = cubes;
  layout.area = {side, side};
  layout.seed = 1;
  layout.half_extents = Vec3::Constant(0.5 * kHeapCubeSide_m);
  layout.bounding_radius = layout.half_extents.norm();
  for (const Pose& place : lay_out(layout)) add_box(world, layout.half_extents, kCubeMass_kg, place);
  return world;
}

}  // namespace subworld::bench
