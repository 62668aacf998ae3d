#include "scene_update.hpp"

#include "cdr_text.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <string_view>

namespace subworld::live {
namespace {

using Colour = std::array<double, 4>;
constexpr Colour kProxy{0.85, 0.12, 0.10, 1.0}, kMember{0.20, 0.40, 0.85, 1.0}, kBorder{0.95, 0.80, 0.15, 1.0},
    kOther{0.82, 0.82, 0.82, 1.0}, kFixed{0.55, 0.60, 0.65, 0.35}, kForce{0.85, 0.12, 0.10, 1.0};
constexpr double kPlane_m = 4.0, kPlaneThickness_m = 1e-3, kLeastForce_n = 1e-3, kArrowWidth_m = 0.004;

struct Item {
  const Body* body;
  const BodyState* state;
  Colour colour;
};

std::vector<Colour> colours_of(const SceneDescription& scene, std::span<const UserView> users) {
  std::vector<Colour> colours;
  for (const Body& body : scene.bodies) colours.push_back(body.fixed() ? kFixed : kOther);
  const auto paint = [&](BodyId id, const Colour& colour) {
    if (index(id) < colours.size()) colours[index(id)] = colour;
  };
  for (const UserView& user : users) {
    for (const BoundaryContact& pair : user.border) {
      if (touches(pair)) paint(pair.inside, kBorder), paint(pair.outside, kBorder);
    }
  }
  for (const UserView& user : users)
    for (const BodyId member : user.members) paint(member, kMember);
  for (const UserView& user : users) paint(user.proxy, kProxy);
  return colours;
}

/// Primitives of one kind, as a sequence: `write` returns how many it has written for an item.
template <class Write>
void put_sequence(CdrText& cdr, std::span<const Item> items, Write write) {
  const std::size_t at = cdr.put_length();
  std::uint32_t length = 0;
  for (const Item& item : items) length += write(item);
  cdr.set_length(at, length);
}

void put_cubes(CdrText& cdr, std::span<const Item> items) {
  put_sequence(cdr, items, [&](const Item& item) -> std::uint32_t {
    const Shape& shape = item.body->shape;
    if (shape.kind != ShapeKind::box && shape.kind != ShapeKind::plane) return 0;
    const bool plane = shape.kind == ShapeKind::plane;
    const Vec3 size = plane ? Vec3(kPlane_m, kPlane_m, kPlaneThickness_m) : Vec3(2.0 * shape.half_extents);
    const Vec3 below = plane ? Vec3(0.0, 0.0, -kPlaneThickness_m / 2.0) : Vec3::Zero();
    cdr.put_pose(item.state->position + item.state->orientation * below, item.state->orientation);
    cdr.put(size);
    cdr.put(item.colour);
    return 1;
  });
}

void put_spheres(CdrText& cdr, std::span<const Item> items) {
  put_sequence(cdr, items, [&](const Item& item) -> std::uint32_t {
    const Shape& shape = item.body->shape;
    const auto put_one = [&](double along) {
      cdr.put_pose(item.state->position + item.state->orientation * Vec3(0.0, 0.0, along), item.state->orientation);
      cdr.put(Vec3(Vec3::Constant(2.0 * shape.radius)));
      cdr.put(item.colour);
    };
    if (shape.kind == ShapeKind::sphere) return put_one(0.0), 1;
    if (shape.kind != ShapeKind::capsule) return 0;
    put_one(shape.half_length);
    put_one(-shape.half_length);
    return 2;
  });
}

void put_cylinders(CdrText& cdr, std::span<const Item> items) {
  put_sequence(cdr, items, [&](const Item& item) -> std::uint32_t {
    const Shape& shape = item.body->shape;
    if (shape.kind != ShapeKind::cylinder && shape.kind != ShapeKind::capsule) return 0;
    cdr.put_pose(item.state->position, item.state->orientation);
    cdr.put(Vec3(2.0 * shape.radius, 2.0 * shape.radius, 2.0 * shape.half_length));
    cdr.put(1.0);
    cdr.put(1.0);
    cdr.put(item.colour);
    return 1;
  });
}

void put_triangles(CdrText& cdr, std::span<const Item> items, std::span<const Mesh> meshes) {
  put_sequence(cdr, items, [&](const Item& item) -> std::uint32_t {
    const Shape& shape = item.body->shape;
    if (shape.kind != ShapeKind::convex && shape.kind != ShapeKind::mesh) return 0;
    if (shape.mesh >= meshes.size()) return 0;
    const Mesh& mesh = meshes[shape.mesh];
    cdr.put_pose(item.state->position, item.state->orientation);
    cdr.put(static_cast<std::uint32_t>(mesh.vertices.size()));
    for (const Vec3& vertex : mesh.vertices) cdr.put(vertex);
    cdr.put(item.colour);
    cdr.put(std::uint32_t{0});
    cdr.put(static_cast<std::uint32_t>(3 * mesh.triangles.size()));
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t corner : triangle) cdr.put(corner);
    return 1;
  });
}

/// An arrow points along x of its pose.
void put_arrows(CdrText& cdr, std::span<const UserView> users, std::span<const BodyState> states) {
  const std::size_t at = cdr.put_length();
  std::uint32_t length = 0;
  for (const UserView& user : users) {
    const double force_n = user.wrench.force.norm();
    if (index(user.proxy) >= states.size() || !(force_n > kLeastForce_n)) continue;
    const double long_m = kArrow_m_per_n * force_n;
    cdr.put_pose(states[index(user.proxy)].position, Quat::FromTwoVectors(Vec3::UnitX(), user.wrench.force));
    for (const double measure : {0.8 * long_m, kArrowWidth_m, 0.2 * long_m, 2.0 * kArrowWidth_m}) cdr.put(measure);
    cdr.put(kForce);
    ++length;
  }
  cdr.set_length(at, length);
}

void begin_entity(CdrText& cdr, std::string_view id, std::uint64_t time_ns) {
  cdr.put_time(time_ns);
  cdr.put_text("world");
  cdr.put_text(id);
  cdr.put(std::int32_t{0});  // lifetime: until it is replaced
  cdr.put(std::uint32_t{0});
  cdr.put(std::uint8_t{0});   // frame_locked
  cdr.put(std::uint32_t{0});  // metadata
}

void put_bodies(CdrText& cdr, std::string_view id, std::span<const Item> items, std::span<const Mesh> meshes,
                std::uint64_t time_ns) {
  begin_entity(cdr, id, time_ns);
  cdr.put(std::uint32_t{0});  // arrows
  put_cubes(cdr, items);
  put_spheres(cdr, items);
  put_cylinders(cdr, items);
  cdr.put(std::uint32_t{0});  // lines
  put_triangles(cdr, items, meshes);
  cdr.put(std::uint32_t{0});  // texts
  cdr.put(std::uint32_t{0});  // models
}

}  // namespace

std::vector<std::uint8_t> scene_update(const SceneDescription& scene, std::span<const BodyState> states,
                                       std::span<const UserView> users, std::uint64_t time_ns) {
  constexpr std::size_t kUsualBodyBytes = 128;
  const std::vector<Colour> colours = colours_of(scene, users);
  std::vector<Item> fixed, movable;
  for (std::size_t i = 0; i < std::min(scene.bodies.size(), states.size()); ++i)
    (scene.bodies[i].fixed() ? fixed : movable).push_back({&scene.bodies[i], &states[i], colours[i]});
  CdrText cdr;
  cdr.reserve(kUsualBodyBytes * (scene.bodies.size() + 8));
  cdr.put(std::uint32_t{0});  // deletions
  cdr.put(std::uint32_t{3});  // entities
  put_bodies(cdr, "fixed", fixed, scene.meshes, time_ns);
  put_bodies(cdr, "bodies", movable, scene.meshes, time_ns);
  begin_entity(cdr, "forces", time_ns);
  put_arrows(cdr, users, states);
  for (int empty = 0; empty < 7; ++empty) cdr.put(std::uint32_t{0});
  return cdr.take();
}

}  // namespace subworld::live
