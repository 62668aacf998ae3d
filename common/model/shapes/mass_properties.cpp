#include "model/shapes/mass_properties.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace subworld {

namespace {

// Mesh files have single precision: a smaller product of inertia is not a tilted axis.
constexpr double kRoundOff = 1e-6;

}  // namespace

double volume(const Shape& shape) noexcept {
  const double r = shape.radius;
  const double length = 2.0 * shape.half_length;
  switch (shape.kind) {
    case ShapeKind::sphere:
      return 4.0 / 3.0 * M_PI * r * r * r;
    case ShapeKind::box:
      return 8.0 * shape.half_extents.prod();
    case ShapeKind::capsule:
      return M_PI * r * r * (length + 4.0 / 3.0 * r);
    case ShapeKind::cylinder:
      return M_PI * r * r * length;
    case ShapeKind::plane:
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:
      break;
  }
  return 0.0;
}

Vec3 principal_inertia(const Shape& shape, double mass_kg) noexcept {
  const double r2 = shape.radius * shape.radius;
  const double h = shape.half_length;
  switch (shape.kind) {
    case ShapeKind::sphere:
      return Vec3::Constant(0.4 * mass_kg * r2);
    case ShapeKind::box: {
      const Vec3 e2 = shape.half_extents.cwiseAbs2();
      return mass_kg / 3.0 * Vec3(e2.y() + e2.z(), e2.x() + e2.z(), e2.x() + e2.y());
    }
    case ShapeKind::cylinder: {
      const double across = mass_kg * (0.25 * r2 + h * h / 3.0);
      return {across, across, 0.5 * mass_kg * r2};
    }
    case ShapeKind::capsule: {
      const double balls = mass_kg * (4.0 / 3.0 * shape.radius) / (2.0 * h + 4.0 / 3.0 * shape.radius);
      const double straight = mass_kg - balls;
      // Each half ball has its centre 3/8 r beyond the end of the straight part (parallel axis theorem, both together).
      const double across = straight * (0.25 * r2 + h * h / 3.0) + balls * (0.4 * r2 + h * h + 0.75 * h * shape.radius);
      return {across, across, 0.5 * straight * r2 + 0.4 * balls * r2};
    }
    case ShapeKind::plane:
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:
      break;
  }
  return Vec3::Zero();
}

Solid integrate(const Mesh& mesh) noexcept {
  Solid solid;
  if (mesh.vertices.empty()) return solid;
  const Vec3 origin = mesh.vertices.front();
  Vec3 first = Vec3::Zero();                         // integral of x
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  // integral of x x^T
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[0]] - origin;
    const Vec3 b = mesh.vertices[t[1]] - origin;
    const Vec3 c = mesh.vertices[t[2]] - origin;
    const double part = a.dot(b.cross(c)) / 6.0;
    const Vec3 sum = a + b + c;
    solid.volume += part;
    first += part / 4.0 * sum;
    second += part / 20.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (solid.volume == 0.0) return solid;
  const Vec3 centre = first / solid.volume;
  second -= solid.volume * centre * centre.transpose();
  solid.centre = origin + centre;
  solid.inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
  return solid;
}

bool closed(const Mesh& mesh) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (!edges.insert({t[i], t[(i + 1) % 3]}).second) return false;
    }
  }
  return !edges.empty() && std::all_of(edges.begin(), edges.end(), [&](const auto& e) {
    return edges.contains({e.second, e.first});
  });
}

bool of_a_body(const Vec3& moments) noexcept {
  constexpr double kRounding = 2e-3;  // of the largest: 0.333 + 0.333 < 0.667
  return moments.minCoeff() > 0.0 && moments.sum() >= (2.0 - kRounding) * moments.maxCoeff();
}

PrincipalAxes principal_axes(const Eigen::Matrix3d& inertia) {
  PrincipalAxes result{.moments = inertia.diagonal()};
  Eigen::Matrix3d products = inertia;
  products.diagonal().setZero();
  if (products.cwiseAbs().maxCoeff() <= kRoundOff * inertia.trace()) return result;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(inertia);
  result.axes = principal.eigenvectors();
  if (result.axes.determinant() < 0.0) result.axes.col(2) *= -1.0;
  result.moments = principal.eigenvalues();
  return result;
}

PrincipalFrame move_to_principal_frame(Mesh& mesh) {
  const Solid solid = integrate(mesh);
  const PrincipalAxes principal = principal_axes(solid.inertia);
  for (Vec3& v : mesh.vertices) v = principal.axes.transpose() * (v - solid.centre);
  return {{solid.centre, Quat(principal.axes).normalized()}, solid.volume, principal.moments};
}

}  // namespace subworld
