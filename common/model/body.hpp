#pragma once

#include "model/material.hpp"
#include "model/types.hpp"

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

enum class ShapeKind : std::uint8_t {
  sphere,    ///< radius
  box,       ///< half_extents
  capsule,   ///< radius, half_length of the straight part, axis z
  cylinder,  ///< radius, half_length, axis z
  plane,     ///< the half-space z <= 0 of the body frame; fixed bodies only
  convex,    ///< convex hull of a mesh
  mesh,      ///< triangles as they are; fixed bodies only
  compound,  ///< the parts of a mesh
};

struct Shape {
  ShapeKind kind = ShapeKind::sphere;
  Vec3 half_extents = Vec3::Zero();  ///< m, box only
  double radius = 0.0;               ///< m
  double half_length = 0.0;          ///< m
  std::uint32_t mesh = 0;            ///< index into `Scene::meshes`
};

/// The pair's friction is the geometric mean of both, its restitution the product.
/// A part of a compound body: none with parts of its own, no plane, no triangles.
struct BodyPart {
  Shape shape;
  Pose pose;  ///< in the body frame
  Material material;
};

/// Triangles in the body frame, of a mesh file or around the parts of a compound body.
struct Mesh {
  std::string file;            ///< path as given in the scene; empty: of parts
  std::vector<Vec3> vertices;  ///< m
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<BodyPart> parts;  ///< what collides in place of the triangles; not in messages
};

/// Properties that stay constant while a body moves.
struct Body {
  BodyId id{};
  std::string name;
  Shape shape;
  Material material;
  double mass = 0.0;            ///< kg; 0: fixed to the world
  Vec3 inertia = Vec3::Zero();  ///< principal moments about the centre of mass, kg m^2; the body frame is principal
  bool gravity = true;
  bool rotates = true;      ///< false: translates only
  std::uint32_t group = 0;  ///< bodies of one group do not collide with each other; 0: none
  /// Sleeps at the start with all bodies at rest that it touches, until another body can reach it.
  bool at_rest = false;
  /// The surface of a fixed body slides and turns about the body's origin, as a belt or a turntable does; the body
  /// stays. World axes, m/s and rad/s; not in messages.
  Vec3 surface_velocity = Vec3::Zero(), surface_turn = Vec3::Zero();

  [[nodiscard]] bool is_driven() const noexcept { return !surface_velocity.isZero(0.0) || !surface_turn.isZero(0.0); }
  [[nodiscard]] bool fixed() const noexcept { return mass == 0.0; }
};

/// State of motion. All in the world frame, at the centre of mass.
struct BodyState {
  Vec3 position = Vec3::Zero();  ///< m
  Quat orientation = Quat::Identity();
  Vec3 linear_velocity = Vec3::Zero();   ///< m/s
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s
};

[[nodiscard]] inline Pose pose_of(const BodyState& state) { return {state.position, state.orientation}; }

struct StampedBody {
  BodyId id{};
  BodyState state;
};

/// A copy without the name. In a loop, a long name would cost an allocation.
[[nodiscard]] Body nameless(const Body& body) noexcept;
[[nodiscard]] bool finite(const BodyState& state) noexcept;
/// Translational and rotational, J.
[[nodiscard]] double kinetic_energy(const Body& body, const BodyState& state) noexcept;

}  // namespace subworld
