#pragma once

#include "model/body.hpp"

#include <ode/ode.h>

#include <map>
#include <span>
#include <utility>
#include <vector>

namespace subworld::ode {

/// Enlargement of movable shapes in ODE (m). ODE detects a contact only when two shapes overlap: without it, a body at
/// rest with a gap of zero would lose its contacts by rounding.
inline constexpr double kSkin = 1e-5;

/// ODE's geometries and their data.
class ShapeStore {
 public:
  explicit ShapeStore(std::span<const Mesh> meshes) : meshes_(meshes.begin(), meshes.end()) {}
  ~ShapeStore();
  ShapeStore(const ShapeStore&) = delete;
  ShapeStore& operator=(const ShapeStore&) = delete;

  /// Makes a geometry outside any space; the caller destroys it before the store. Throws `Error` (usage) if a mesh
  /// index is out of range.
  [[nodiscard]] dGeomID make(const Shape& shape);
  /// Of a compound shape. Throws as make().
  [[nodiscard]] std::span<const BodyPart> parts(const Shape& shape) const;
  /// The back of a mesh, for whose triangles ODE knows a front only; null for another kind.
  [[nodiscard]] dGeomID make_back(const Shape& shape);
  /// Corners of the hull of a `convex` that was made, skin included; empty for another kind.
  [[nodiscard]] std::span<const double> hull_points(const Shape& shape) const;

 private:
  /// In ODE's format; ODE stores pointers to all three.
  struct Hull {
    std::vector<dReal> planes, points;
    std::vector<unsigned> polygons;
  };
  struct Triangles {
    dTriMeshDataID data;
    std::vector<dReal> vertices;
    std::vector<dTriIndex> indices;
  };
  [[nodiscard]] static Hull grown_hull(const Mesh& mesh);
  [[nodiscard]] Triangles& triangles(const Shape& shape, bool back);

  std::vector<Mesh> meshes_;
  std::map<std::uint32_t, Hull> hulls_;                            ///< by mesh
  std::map<std::pair<std::uint32_t, bool>, Triangles> triangles_;  ///< by mesh, and whether they are its back
};

/// Enlargement of ODE's geometry of this kind (m).
[[nodiscard]] constexpr double skin(ShapeKind kind) noexcept {
  return kind == ShapeKind::plane || kind == ShapeKind::mesh ? 0.0 : kSkin;
}

/// Points of a mesh that ODE may list: with fewer, it would end at the first of many narrow triangles.
inline constexpr int kMostOfMesh = 1024;
/// Upper bound of the contact points that ODE lists for such shapes: hulls and meshes list every touching vertex.
[[nodiscard]] constexpr int most_points(ShapeKind a, ShapeKind b) noexcept {
  if (a == ShapeKind::mesh || b == ShapeKind::mesh) return kMostOfMesh;
  return a == ShapeKind::convex || b == ShapeKind::convex ? 16 : 4;
}

}  // namespace subworld::ode
