#pragma once

#include "model/body.hpp"
#include "model/scene/scene.hpp"

#include <string>

namespace subworld::test {

inline Body cube(BodyId id, double side = 0.1, double mass = 0.2) {
  Body body;
  body.id = id;
  body.name = "cube" + std::to_string(index(id));
  body.shape.kind = ShapeKind::box;
  body.shape.half_extents = Vec3::Constant(0.5 * side);
  body.mass = mass;
  body.inertia = Vec3::Constant(mass * side * side / 6.0);
  return body;
}

inline Body floor_plane(BodyId id) {
  Body body;
  body.id = id;
  body.name = "floor";
  body.shape.kind = ShapeKind::plane;
  return body;
}

inline Body ball_proxy(BodyId id, double radius = 0.03, double mass = 0.1) {
  Body body;
  body.id = id;
  body.name = "proxy";
  body.shape.kind = ShapeKind::sphere;
  body.shape.radius = radius;
  body.mass = mass;
  body.inertia = Vec3::Constant(0.4 * mass * radius * radius);
  body.gravity = false;
  body.rotates = false;
  return body;
}

/// Adds a ball without gravity, and returns it.
inline Body& throw_ball(Scene& scene, const Vec3& from, const Vec3& velocity) {
  constexpr double kRadius_m = 0.04, kMass_kg = 0.1;
  Body ball = ball_proxy(BodyId{static_cast<std::uint32_t>(scene.bodies.size())}, kRadius_m, kMass_kg);
  ball.name = "ball";
  ball.rotates = true;
  BodyState state;
  state.position = from;
  state.linear_velocity = velocity;
  scene.initial.push_back(state);
  return scene.bodies.emplace_back(ball);
}

inline BodyState at(double x, double y, double z) {
  BodyState state;
  state.position = Vec3(x, y, z);
  return state;
}

}  // namespace subworld::test
