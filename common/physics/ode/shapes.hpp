#pragma once

#include "model/body.hpp"

#include <ode/ode.h>

#include <map>
#include <span>
#include <vector>

namespace subworld::ode {

/// By how much movable shapes are larger for ODE than they are (m). ODE knows of a contact only once two shapes
/// overlap: a body that rests with a gap of nought would lose its contacts at every rounding.
inline constexpr double kSkin = 1e-5;

/// ODE's geometries, and the data that they point to.
class ShapeStore {
 public:
  explicit ShapeStore(std::span<const Mesh> meshes) : meshes_(meshes.begin(), meshes.end()) {}
  ~ShapeStore();
  ShapeStore(const ShapeStore&) = delete;
  ShapeStore& operator=(const ShapeStore&) = delete;

  /// A geometry outside any space; the caller destroys it before the store. Throws `Error` (usage) for a mesh index
  /// out of range.
  [[nodiscard]] dGeomID make(const Shape& shape);
  /// Corners of the hull of a `convex` that was made, skin included; none for another kind.
  [[nodiscard]] std::span<const double> hull_points(const Shape& shape) const;

 private:
  /// As ODE wants it; it keeps pointers to all three.
  struct Hull {
    std::vector<dReal> planes, points;
    std::vector<unsigned> polygons;
  };
  struct Triangles {
    dTriMeshDataID data;
    std::vector<dReal> vertices;
    std::vector<dTriIndex> indices;
  };
  [[nodiscard]] const Mesh& mesh(const Shape& shape) const;
  [[nodiscard]] static Hull grown_hull(const Mesh& mesh);
  [[nodiscard]] Triangles& triangles(const Shape& shape);

  std::vector<Mesh> meshes_;
  std::map<std::uint32_t, Hull> hulls_;           ///< by mesh
  std::map<std::uint32_t, Triangles> triangles_;  ///< by mesh
};

/// How far ODE's geometry reaches beyond the shape (m).
[[nodiscard]] constexpr double skin(ShapeKind kind) noexcept {
  return kind == ShapeKind::plane || kind == ShapeKind::mesh ? 0.0 : kSkin;
}

/// Most points that a pair of such shapes can need: hulls and meshes list every vertex that touches.
[[nodiscard]] constexpr int most_points(ShapeKind a, ShapeKind b) noexcept {
  const auto faceted = [](ShapeKind kind) { return kind == ShapeKind::convex || kind == ShapeKind::mesh; };
  return faceted(a) || faceted(b) ? 16 : 4;
}

}  // namespace subworld::ode
