#pragma once

#include "patch.hpp"
#include "physics/triangle_edges.hpp"
#include "shapes.hpp"

#include <ode/ode.h>

#include <span>
#include <vector>

namespace subworld::ode {

/// Replaces ODE's points of a solid (not a sphere) on triangles. ODE takes the least overlap of a triangle for its
/// contact: where a solid has just begun to cover one, that is the solid's side, which stops at each inner edge. For
/// hulls it misses triangles, and its normals are inexact. Now each triangle that a solid overlaps has all points of
/// the solid's patch on it, and contacts at inner edges are omitted.
class MeshPoints {
 public:
  MeshPoints() : probe_(dCreateBox(nullptr, 1.0, 1.0, 1.0)), near_(kMostOfMesh) {}
  ~MeshPoints() { dGeomDestroy(probe_); }
  MeshPoints(const MeshPoints&) = delete;
  MeshPoints& operator=(const MeshPoints&) = delete;

  /// `found`: ODE's points of the solid, whose geometry is `geom`, and a mesh; `solid_is_first` of their bodies. The
  /// result is valid until the next call.
  [[nodiscard]] std::span<dContactGeom> refine(const Solid& solid, dGeomID geom, bool solid_is_first,
                                               std::span<const dContactGeom> found);

 private:
  struct Triangle {
    int number = 0;
    TriangleCorners corners;
    Vec3 normal;
    bool patched = false;
  };
  void list_triangles(dGeomID geom, dGeomID mesh, bool solid_is_first, std::span<const dContactGeom> found);
  /// Adds the points of a solid's patch on a triangle, unless one is deeper than `most_m`.
  void add_patch(const Solid& solid, Triangle& triangle, double most_m, dContactGeom like, bool solid_is_first);

  dGeomID probe_;
  std::vector<dContactGeom> near_;  ///< of the probe
  std::vector<Triangle> triangles_;
  std::vector<dContactGeom> points_;
};

}  // namespace subworld::ode
