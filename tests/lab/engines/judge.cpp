#include "lab/engines/judge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

const char* const kHeldInWords =
    "A run has held when the engine did not fail, all numbers are finite, and no contact is deeper than half of the "
    "smallest dimension of the touching bodies. In a structure (at least half of the bodies touch another one at the "
    "start), in addition, no point of a body has moved by more than half of the body's longest dimension. In a falling "
    "scene, in addition, no body's centre has left the box around all bodies at the start.";

namespace {

constexpr double kTouchRatio = 0.01;

/// Half dimensions in the body frame, m; infinite for a plane.
Vec3 half_dimensions(const Scene& scene, const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.half_extents;
    case ShapeKind::sphere:
      return Vec3::Constant(shape.radius);
    case ShapeKind::capsule:
      return {shape.radius, shape.radius, shape.half_length + shape.radius};
    case ShapeKind::cylinder:
      return {shape.radius, shape.radius, shape.half_length};
    case ShapeKind::plane:
      return Vec3::Constant(std::numeric_limits<double>::infinity());
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:
      break;
  }
  Vec3 half = Vec3::Zero();
  for (const Vec3& v : scene.meshes[shape.mesh].vertices) half = half.cwiseMax(v.cwiseAbs());
  return half;
}

Box bounds_of(const Vec3& half, const BodyState& state, double margin) {
  const Vec3 reach = (state.orientation.toRotationMatrix().cwiseAbs() * half).array() + margin;
  return {state.position - reach, state.position + reach};
}

/// Bounds of all bodies but planes, at the start.
struct Bounds {
  std::vector<BodyId> ids;
  std::vector<Box> boxes;
};
Bounds bounds_of(const Scene& scene) {
  Bounds all;
  for (const Body& body : scene.bodies) {
    if (body.shape.kind == ShapeKind::plane) continue;
    all.ids.push_back(body.id);
    all.boxes.push_back(bounds_of(half_dimensions(scene, body.shape), scene.initial[index(body.id)], 0.0));
  }
  return all;
}

}  // namespace

SceneKind kind_of(const Scene& scene) {
  const Bounds all = bounds_of(scene);
  std::size_t movable = 0, touching = 0;
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    ++movable;
    const Vec3 half = half_dimensions(scene, body.shape);
    const Box near = bounds_of(half, scene.initial[index(body.id)], kTouchRatio * 2.0 * half.minCoeff());
    for (std::size_t i = 0; i < all.ids.size(); ++i) {
      if (all.ids[i] == body.id || scene.body(all.ids[i]).fixed() || !all.boxes[i].meets(near)) continue;
      ++touching;
      break;
    }
  }
  return 2 * touching >= movable ? SceneKind::structure : SceneKind::fall;
}

Judge::Judge(const Scene& scene, SceneKind kind) : kind_(kind), gravity_(scene.settings.world.gravity) {
  const Bounds all = bounds_of(scene);
  if (!all.boxes.empty()) arena_ = all.boxes.front();
  for (const Box& box : all.boxes) arena_.extend(box);
  for (const Body& body : scene.bodies) {
    const Vec3 half = half_dimensions(scene, body.shape);
    smallest_m_.push_back(2.0 * half.minCoeff());
    if (body.fixed()) continue;
    const bool turns = body.rotates && body.shape.kind != ShapeKind::sphere;
    movable_.push_back({&body, scene.initial[index(body.id)], 2.0 * half.maxCoeff(), turns ? half.norm() : 0.0});
    if (movable_.back().start.position.z() > movable_[top_].start.position.z()) top_ = movable_.size() - 1;
    mass_kg_ += body.mass;
    longest_m_ = std::max(longest_m_, movable_.back().longest_m);
  }
}

bool Judge::lost(const Watched& one, const BodyState& now) const {
  if (kind_ == SceneKind::fall) return !arena_.meets({now.position, now.position});
  const double half_angle = 0.5 * one.start.orientation.angularDistance(now.orientation);
  const double moved_m = (now.position - one.start.position).norm() + 2.0 * std::sin(half_angle) * one.reach_m;
  return moved_m > kFallenRatio * one.longest_m;
}

void Judge::look_at_contacts(const Engine& engine, Observed& seen) const {
  for (const Contact& contact : engine.contacts()) {
    const double depth_m = std::max(0.0, -contact.distance);
    const double smallest_m = std::min(smallest_m_[index(contact.a)], smallest_m_[index(contact.b)]);
    seen.penetration_max_m = std::max(seen.penetration_max_m, depth_m);
    seen.penetration_ratio = std::max(seen.penetration_ratio, depth_m / smallest_m);
  }
  seen.contacts = engine.contacts().size();
}

Observed Judge::look(const Engine& engine, double t_s) const {
  Observed seen;
  seen.t_s = t_s;
  for (std::size_t i = 0; i < movable_.size(); ++i) {
    const Watched& one = movable_[i];
    const BodyState now = engine.state(one.body->id);
    seen.finite = seen.finite && finite(now);
    seen.kinetic_j += kinetic_energy(*one.body, now);
    const Vec3 moved = now.position - one.start.position;
    if (one.body->gravity) seen.potential_j -= one.body->mass * gravity_.dot(moved);
    seen.displacement_max_m = std::max(seen.displacement_max_m, moved.norm());
    if (i == top_) seen.top_displacement_m = moved.norm();
    seen.fallen = seen.fallen || lost(one, now);
  }
  look_at_contacts(engine, seen);
  return seen;
}

bool Judge::at_rest(double kinetic_j) const {
  const double speed = std::sqrt(2.0 * kinetic_j / mass_kg_);
  return speed <= kRestRatio * std::sqrt(gravity_.norm() * longest_m_);
}

}  // namespace subworld
