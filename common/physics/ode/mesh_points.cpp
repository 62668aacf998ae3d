#include "mesh_points.hpp"

#include "body.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld::ode {

namespace {

int triangle_of(const dContactGeom& point, bool solid_is_first) { return solid_is_first ? point.side2 : point.side1; }

}  // namespace

void MeshPoints::list_triangles(dGeomID geom, dGeomID mesh, bool solid_is_first, std::span<const dContactGeom> found) {
  triangles_.clear();
  for (const dContactGeom& point : found) triangles_.emplace_back().number = triangle_of(point, solid_is_first);
  if (dGeomGetClass(geom) == dConvexClass) {
    std::array<dReal, 6> box;
    dGeomGetAABB(geom, box.data());
    dGeomBoxSetLengths(probe_, box[1] - box[0], box[3] - box[2], box[5] - box[4]);
    dGeomSetPosition(probe_, 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3]), 0.5 * (box[4] + box[5]));
    const int count = dCollide(probe_, mesh, kMostOfMesh, near_.data(), sizeof(dContactGeom));
    for (int i = 0; i < count; ++i) triangles_.emplace_back().number = near_[static_cast<std::size_t>(i)].side2;
  }
  std::ranges::sort(triangles_, {}, &Triangle::number);
  const auto rest = std::ranges::unique(triangles_, {}, &Triangle::number);
  triangles_.erase(rest.begin(), rest.end());
  for (Triangle& one : triangles_) {
    std::array<dVector3, 3> corners;
    dGeomTriMeshGetTriangle(mesh, one.number, &corners[0], &corners[1], &corners[2]);
    for (std::size_t i = 0; i < 3; ++i) one.corners[i] = from_ode(corners[i]);
    one.normal = (one.corners[1] - one.corners[0]).cross(one.corners[2] - one.corners[0]).normalized();
  }
}

void MeshPoints::add_patch(const Solid& solid, Triangle& triangle, double most_m, dContactGeom like,
                           bool solid_is_first) {
  static const Shape kTriangle{.kind = ShapeKind::convex};
  const double above = (solid.pose.position - triangle.corners[0]).dot(triangle.normal);
  Vec3 normal = std::copysign(1.0, above) * triangle.normal;
  const auto points = patch(solid, {&kTriangle, {}, {triangle.corners[0].data(), 9}}, normal);
  if (points.empty() || std::ranges::max(points, {}, &PatchPoint::depth).depth > most_m) return;
  triangle.patched = true;
  if (!solid_is_first) normal = -normal;
  std::copy_n(normal.data(), 3, like.normal);
  for (const PatchPoint& point : points) {
    std::copy_n(point.point.data(), 3, like.pos);
    like.depth = point.depth;
    points_.push_back(like);
  }
}

std::span<dContactGeom> MeshPoints::refine(const Solid& solid, dGeomID geom, bool solid_is_first,
                                           std::span<const dContactGeom> found) {
  points_.clear();
  if (found.empty()) return points_;
  list_triangles(geom, solid_is_first ? found[0].g2 : found[0].g1, solid_is_first, found);
  // The overlap along a triangle's normal counts if it is not larger than ODE's overlaps.
  const double most_m = std::ranges::max(found, {}, &dContactGeom::depth).depth + kSkin;
  for (Triangle& triangle : triangles_) add_patch(solid, triangle, most_m, found[0], solid_is_first);
  for (const dContactGeom& point : found) {
    const Triangle& on = *find_sorted(triangles_, triangle_of(point, solid_is_first), &Triangle::number);
    const Vec3 at = from_ode(point.pos), up = (solid_is_first ? 1.0 : -1.0) * from_ode(point.normal);
    if (on.patched || std::abs(on.normal.dot(at - on.corners[0])) > most_m) continue;  // libccd's may be elsewhere
    const auto continues = [&](const Triangle& other) { return rises(other.corners, at, up, most_m); };
    if (std::ranges::none_of(triangles_, continues)) points_.push_back(point);
  }
  return points_;
}

}  // namespace subworld::ode
