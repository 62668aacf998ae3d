#include "shapes.hpp"

#include "model/error.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/vectors.hpp"
#include "physics/adapter.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace subworld::ode {

ShapeStore::~ShapeStore() {
  for (auto& [mesh, held] : triangles_) dGeomTriMeshDataDestroy(held.data);
}

namespace {

/// Normals of the faces at each vertex of a hull.
std::vector<std::vector<Vec3>> normals_at_vertices(const Mesh& hull) {
  std::vector<std::vector<Vec3>> normals(hull.vertices.size());
  for (const auto& corners : hull.triangles) {
    const Vec3& p = hull.vertices[corners[0]];
    const Vec3 normal = (hull.vertices[corners[1]] - p).cross(hull.vertices[corners[2]] - p).normalized();
    for (const std::uint32_t corner : corners) normals[corner].push_back(normal);
  }
  return normals;
}

/// A hull without the vertices within its faces and edges. With them, the solver would have more points of a divided
/// face than it can solve, and stacks would creep.
Mesh hull_of_corners(const Mesh& source) {
  constexpr double kBent = 1e-3;  // sine of the least angle between faces
  Mesh hull = convex_hull(source);
  const auto normals = normals_at_vertices(hull);
  std::vector<Vec3> corners;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Vec3& normal : normals[i]) spread += normal * normal.transpose();
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues().x();
    if (least > kBent * kBent) corners.push_back(hull.vertices[i]);
  }
  if (corners.size() == hull.vertices.size() || corners.size() < 4) return hull;
  hull.vertices = corners;
  return convex_hull(hull);
}

}  // namespace

ShapeStore::Hull ShapeStore::grown_hull(const Mesh& source) {
  const Mesh hull = hull_of_corners(source);
  Hull grown;
  const auto normals = normals_at_vertices(hull);
  for (const auto& corners : hull.triangles) {
    const Vec3& p = hull.vertices[corners[0]];
    const Vec3 normal = (hull.vertices[corners[1]] - p).cross(hull.vertices[corners[2]] - p).normalized();
    grown.planes.insert(grown.planes.end(), {normal.x(), normal.y(), normal.z(), normal.dot(p) + kSkin});
    grown.polygons.insert(grown.polygons.end(), {3U, corners[0], corners[1], corners[2]});
  }
  // Each vertex moves to the intersection of the enlarged faces; with more than three, in the sense of least squares.
  for (std::size_t i = 0; i < hull.vertices.size(); ++i) {
    Eigen::Matrix<double, Eigen::Dynamic, 3> faces(static_cast<Eigen::Index>(normals[i].size()), 3);
    for (std::size_t f = 0; f < normals[i].size(); ++f) faces.row(static_cast<Eigen::Index>(f)) = normals[i][f];
    const Vec3 shift = faces.completeOrthogonalDecomposition().solve(Eigen::VectorXd::Constant(faces.rows(), kSkin));
    const Vec3 vertex = hull.vertices[i] + shortened(shift, 3.0 * kSkin);  // it is longer at a needle's tip
    grown.points.insert(grown.points.end(), {vertex.x(), vertex.y(), vertex.z()});
  }
  return grown;
}

ShapeStore::Triangles& ShapeStore::triangles(const Shape& shape, bool back) {
  const Mesh& source = mesh_of(shape, meshes_);
  const auto [entry, is_new] = triangles_.try_emplace({shape.mesh, back});
  Triangles& held = entry->second;
  if (!is_new) return held;
  for (const Vec3& v : source.vertices) held.vertices.insert(held.vertices.end(), {v.x(), v.y(), v.z()});
  for (const auto& t : source.triangles)
    held.indices.insert(held.indices.end(), {t[0], t[back ? 2 : 1], t[back ? 1 : 2]});
  held.data = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(held.data, held.vertices.data(), 3 * sizeof(dReal),
                              static_cast<int>(source.vertices.size()), held.indices.data(),
                              static_cast<int>(held.indices.size()), 3 * sizeof(dTriIndex));
  // With the angles between triangles, ODE turns hull contacts away from triangles whose edge they meet from behind.
  dGeomTriMeshDataPreprocess2(held.data, 1U << dTRIDATAPREPROCESS_BUILD_FACE_ANGLES, nullptr);
  return held;
}

std::span<const double> ShapeStore::hull_points(const Shape& shape) const {
  if (shape.kind != ShapeKind::convex) return {};
  return hulls_.at(shape.mesh).points;
}

std::span<const BodyPart> ShapeStore::parts(const Shape& shape) const { return mesh_of(shape, meshes_).parts; }

dGeomID ShapeStore::make_back(const Shape& shape) {
  if (shape.kind != ShapeKind::mesh) return nullptr;
  return dCreateTriMesh(nullptr, triangles(shape, true).data, nullptr, nullptr, nullptr);
}

dGeomID ShapeStore::make(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return dCreateSphere(nullptr, shape.radius + kSkin);
    case ShapeKind::box: {
      const Vec3 size = 2.0 * (shape.half_extents.array() + kSkin);
      return dCreateBox(nullptr, size.x(), size.y(), size.z());
    }
    case ShapeKind::capsule:
      return dCreateCapsule(nullptr, shape.radius + kSkin, 2.0 * shape.half_length);
    case ShapeKind::cylinder:
      return dCreateCylinder(nullptr, shape.radius + kSkin, 2.0 * (shape.half_length + kSkin));
    case ShapeKind::plane:
      return dCreatePlane(nullptr, 0, 0, 1, 0);
    case ShapeKind::convex: {
      // ODE finds a hull's contacts through libccd: the deepest point, and a few more by tilting one of both a little.
      // For solids ode/patch.hpp finds the others; on a mesh a hull rests less steadily than a box.
      const Mesh& source = mesh_of(shape, meshes_);
      const auto [entry, is_new] = hulls_.try_emplace(shape.mesh);
      if (is_new) entry->second = grown_hull(source);
      const Hull& hull = entry->second;
      return dCreateConvex(nullptr, hull.planes.data(), static_cast<unsigned>(hull.planes.size() / 4),
                           hull.points.data(), static_cast<unsigned>(hull.points.size() / 3), hull.polygons.data());
    }
    case ShapeKind::mesh:
      return dCreateTriMesh(nullptr, triangles(shape, false).data, nullptr, nullptr, nullptr);
    case ShapeKind::compound:
      break;
  }
  throw Error(ExitCode::usage, "ODE does not know this kind of shape");
}

}  // namespace subworld::ode
