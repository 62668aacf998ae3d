// The bodies of the structures.

#include "lab/random/structures.hpp"

#include "model/shapes/mass_properties.hpp"
#include "model/trigonometry.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// Single precision, as in a mesh file.
Vec3 single(const Vec3& v) { return v.cast<float>().cast<double>(); }

/// A ground so large that no body reaches its edge, with hills or flat.
Mesh ground_mesh(Draw& draw, double half_m, double hill_m) {
  constexpr std::uint32_t kSide = 7;
  Mesh mesh;
  for (std::uint32_t i = 0; i < kSide; ++i) {
    for (std::uint32_t k = 0; k < kSide; ++k)
      mesh.vertices.push_back(
          single({rounded(half_m * (2.0 * i / (kSide - 1) - 1.0)), rounded(half_m * (2.0 * k / (kSide - 1) - 1.0)),
                  -rounded(draw.between(0.0, hill_m))}));
  }
  for (std::uint32_t i = 0; i + 1 < kSide; ++i) {
    for (std::uint32_t k = 0; k + 1 < kSide; ++k) {
      const std::uint32_t a = i * kSide + k, b = a + kSide;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

}  // namespace

double reach_m(const Scene& scene, const Shape& shape, const Quat& orientation, const Vec3& direction) {
  const Vec3 d = orientation.conjugate() * direction;
  const double across = std::hypot(d.x(), d.y());
  switch (shape.kind) {
    case ShapeKind::sphere:
      return shape.radius;
    case ShapeKind::box:
      return d.cwiseAbs().dot(shape.half_extents);
    case ShapeKind::capsule:
      return shape.radius + std::abs(d.z()) * shape.half_length;
    case ShapeKind::cylinder:
      return across * shape.radius + std::abs(d.z()) * shape.half_length;
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound: {
      double most = -INFINITY;
      for (const Vec3& v : scene.meshes[shape.mesh].vertices) most = std::max(most, d.dot(v));
      return most;
    }
    case ShapeKind::plane:
      break;
  }
  return INFINITY;
}

Box bounds_of(const Scene& scene, const Body& body, const BodyState& state) {
  Box box;
  for (int i = 0; i < 3; ++i) {
    box.upper[i] = state.position[i] + reach_m(scene, body.shape, state.orientation, Vec3::Unit(i));
    box.lower[i] = state.position[i] - reach_m(scene, body.shape, state.orientation, -Vec3::Unit(i));
  }
  return box;
}

BodyId Builder::add(Body body, const BodyState& state, const std::string& name) {
  body.id = static_cast<BodyId>(scene_.bodies.size());
  body.name = fmt::format("{}{}", name, made_++);
  scene_.bodies.push_back(body);
  scene_.initial.push_back(state);
  return body.id;
}

BodyId Builder::add_fixed(const Shape& shape, const Pose& pose, const std::string& name) {
  Body body;
  body.shape = shape;
  body.material = draw_material();
  body.gravity = false;
  BodyState state;
  state.position = pose.position;
  state.orientation = pose.orientation;
  return add(body, state, name);
}

void Builder::add_floor(double half_m) {
  const int kind = draw_.whole(0, 9);
  if (kind < 5) {
    add_fixed({.kind = ShapeKind::plane}, {}, "floor");
  } else if (kind < 8) {
    const double thick = 0.25 * half_m;
    add_fixed({.kind = ShapeKind::box, .half_extents = {half_m, half_m, thick}}, {{0.0, 0.0, -thick}, Quat::Identity()},
              "floor");
  } else {
    const double hill_m = draw_.chance(0.5) ? 0.0 : 0.1 * ranges_.size_m;
    scene_.meshes.push_back(ground_mesh(draw_, half_m, hill_m));
    add_fixed({.kind = ShapeKind::mesh, .mesh = static_cast<std::uint32_t>(scene_.meshes.size() - 1)}, {}, "floor");
  }
}

Material Builder::draw_material() {
  return ranges_.materials[static_cast<std::size_t>(draw_.whole(0, static_cast<int>(ranges_.materials.size()) - 1))];
}

Quat Builder::draw_yaw() { return rotation_deg(Vec3::UnitZ(), rounded(draw_.between(0.0, 360.0))); }

Quat Builder::draw_orientation() {
  const Vec3 axis = rounded(draw_.direction());
  return rotation_deg(axis.normalized(), rounded(draw_.between(0.0, 180.0)));
}

std::uint32_t Builder::add_hull(double size_m) {
  Mesh hull;
  while (hull.triangles.empty()) {
    Mesh points;
    const int count = draw_.whole(6, 14);
    const Vec3 half = 0.5 * size_m * Vec3(1.0, draw_.between(0.6, 1.0), draw_.between(0.6, 1.0));
    for (int i = 0; i < count; ++i) points.vertices.push_back(single(rounded(half.cwiseProduct(draw_.direction()))));
    hull = convex_hull(points);
    // Thin slivers are not tested here.
    if (!hull.triangles.empty() && move_to_principal_frame(hull).volume < 0.1 * half.prod()) hull = {};
  }
  for (Vec3& v : hull.vertices) v = single(v);
  scene_.meshes.push_back(hull);
  return static_cast<std::uint32_t>(scene_.meshes.size() - 1);
}

Shape Builder::draw_shape(ShapeKind kind, double size_m) {
  const auto side = [&] {
    return 0.5 * rounded(std::clamp(size_m * draw_.between(0.5, 1.0), ranges_.least_size_m, ranges_.most_size_m));
  };
  Shape shape{.kind = kind};
  if (kind == ShapeKind::box) shape.half_extents = {side(), side(), side()};
  if (kind == ShapeKind::sphere || kind == ShapeKind::capsule || kind == ShapeKind::cylinder) shape.radius = side();
  if (kind == ShapeKind::capsule) shape.half_length = rounded(draw_.between(0.2, 1.0) * shape.radius);
  if (kind == ShapeKind::cylinder) shape.half_length = rounded(draw_.between(0.5, 1.5) * shape.radius);
  if (kind == ShapeKind::convex) shape.mesh = add_hull(std::max(ranges_.least_size_m, size_m));
  return shape;
}

void Builder::set_mass(Body& body, double mass_kg) const {
  body.mass = mass_kg;
  if (body.shape.kind == ShapeKind::convex) {
    Mesh copy = scene_.meshes[body.shape.mesh];
    const PrincipalFrame frame = move_to_principal_frame(copy);
    body.inertia = mass_kg / frame.volume * frame.inertia;
  } else {
    body.inertia = mass_kg * principal_inertia(body.shape, 1.0);  // as the scene reader does
  }
}

Body Builder::draw_body(bool flat) {
  const ShapeKind kind = flat ? draw_.one_of({ShapeKind::box, ShapeKind::box, ShapeKind::cylinder})
                              : draw_.one_of({ShapeKind::sphere, ShapeKind::box, ShapeKind::box, ShapeKind::capsule,
                                              ShapeKind::cylinder, ShapeKind::convex, ShapeKind::convex});
  Body body;
  body.shape = draw_shape(kind, ranges_.size_m * draw_.between(0.6, 1.2));
  body.material = draw_material();
  const double spread = ranges_.mass_spread;
  set_mass(body, rounded(std::clamp(ranges_.mass_kg * draw_.factor(1.0 / spread, spread), ranges_.least_mass_kg,
                                    ranges_.most_mass_kg)));
  return body;
}

}  // namespace subworld
