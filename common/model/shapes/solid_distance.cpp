#include "model/shapes/solid_distance.hpp"

#include "model/shapes/mass_properties.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr std::size_t kRounds = 50;  ///< until a hull has the points that it needs
constexpr double kSliver = 1e-5;     ///< height of a triangle to its longest edge

double distance_m(const Vec3& p, const Corners& t) {
  const Vec3 normal = crossed(t);
  bool over = normal.squaredNorm() > 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 along = t[(i + 1) % 3] - t[i], from = p - t[i];
    over = over && normal.cross(along).dot(from) >= 0.0;
    const double length2 = along.squaredNorm();
    const double part = length2 > 0.0 ? std::clamp(along.dot(from) / length2, 0.0, 1.0) : 0.0;
    least = std::min(least, (from - part * along).squaredNorm());
  }
  return over ? std::abs(normal.dot(p - t[0])) / normal.norm() : std::sqrt(least);
}

const Vec3& farthest(const std::vector<Vec3>& points, const Vec3& way) {
  return *std::ranges::max_element(points, {}, [&](const Vec3& p) { return way.dot(p); });
}

}  // namespace

Corners corners(const Mesh& mesh, std::size_t i) {
  const auto& t = mesh.triangles[i];
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

std::vector<Vec3> samples(const Mesh& mesh, std::size_t count, bool inside) {
  double area = 0.0;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& v : mesh.vertices) middle += v / static_cast<double>(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) area += crossed(corners(mesh, i)).norm();
  std::vector<Vec3> points;
  double due = 0.5;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto [a, b, c] = corners(mesh, i);
    for (due += static_cast<double>(count) * (b - a).cross(c - a).norm() / area; due >= 1.0; due -= 1.0) {
      // Martin Roberts' sequence of low discrepancy.
      const auto k = static_cast<double>(points.size());
      double u = std::fmod(0.5 + k * 0.7548776662466927, 1.0), v = std::fmod(0.5 + k * 0.5698402909980532, 1.0);
      if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
      const Vec3 at = a + u * (b - a) + v * (c - a);
      const double way = inside && points.size() % 2 ? std::fmod(k * 0.6180339887498949, 1.0) : 0.0;
      points.push_back(at + way * (middle - at));
    }
  }
  return points;
}

std::vector<Plane> faces(const Mesh& hull) {
  std::vector<Plane> planes;
  for (std::size_t i = 0; i < hull.triangles.size(); ++i) {
    const Corners t = corners(hull, i);
    const double edge2 = std::max((t[1] - t[0]).squaredNorm(), (t[2] - t[0]).squaredNorm());
    const Vec3 normal = crossed(t);
    if (normal.norm() > kSliver * edge2) planes.push_back({normal.normalized(), normal.normalized().dot(t[0])});
  }
  return planes;
}

SolidDistance::SolidDistance(const Mesh& mesh) : mesh_(mesh) {
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Corners t = corners(mesh, i);
    const Vec3 middle = (t[0] + t[1] + t[2]) / 3.0;
    double radius = 0.0;
    for (const Vec3& v : t) radius = std::max(radius, (v - middle).norm());
    balls_.emplace_back(middle, radius);
  }
}

double SolidDistance::winding(const Vec3& p) const {
  double angle = 0.0;
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    const auto [ca, cb, cc] = corners(mesh_, i);
    const Vec3 a = ca - p, b = cb - p, c = cc - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle / (2.0 * M_PI);
}

double SolidDistance::outside_m(const Vec3& p, double at_least_m) const {
  double least = distance_m(p, corners(mesh_, nearest_));
  for (std::size_t i = 0; i < balls_.size() && least > at_least_m; ++i) {
    const auto& [middle, radius] = balls_[i];
    if ((p - middle).squaredNorm() > (least + radius) * (least + radius)) continue;
    const double m = distance_m(p, corners(mesh_, i));
    if (m < least) least = m, nearest_ = i;
  }
  return least > at_least_m && winding(p) < 0.5 ? least : 0.0;
}

double uncovered_m(const Mesh& mesh, const std::vector<Mesh>& hulls, std::size_t samples_each) {
  std::vector<std::vector<Plane>> planes;
  for (const Mesh& hull : hulls) planes.push_back(faces(hull));
  double most = 0.0;
  for (const Vec3& p : samples(mesh, samples_each * hulls.size(), false)) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t h = 0; h < hulls.size() && least > most; ++h) {
      double height = -1.0, distance = std::numeric_limits<double>::infinity();
      for (const Plane& face : planes[h]) height = std::max(height, face.height(p));
      if (height >= least) continue;
      for (std::size_t f = 0; f < hulls[h].triangles.size() && height > 0.0; ++f)
        distance = std::min(distance, distance_m(p, corners(hulls[h], f)));
      least = std::min(least, height > 0.0 ? distance : 0.0);
    }
    most = std::max(most, least);
  }
  return most;
}

Mesh hull_near(const std::vector<Vec3>& points, double near_m) {
  Mesh some;
  if (points.empty()) return some;
  for (int i = 0; i < 27; ++i) some.vertices.push_back(farthest(points, Vec3(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
  Mesh hull = convex_hull(some);
  if (hull.triangles.empty()) {
    some.vertices = points;
    hull = convex_hull(some);
  }
  for (std::size_t round = 0; round < kRounds; ++round) {
    some.vertices = hull.vertices;
    for (const Plane& face : faces(hull)) {
      const Vec3& most = farthest(points, face.normal);
      if (face.height(most) > near_m) some.vertices.push_back(most);
    }
    if (some.vertices.size() == hull.vertices.size()) break;
    hull = convex_hull(some);
  }
  return hull;
}

}  // namespace subworld
