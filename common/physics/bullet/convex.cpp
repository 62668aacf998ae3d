#include "physics/bullet/convex.hpp"

#include "model/shapes/mass_properties.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace subworld::bullet {

namespace {

/// Triangles of a hull that are coplanar within this share of its size form one face.
constexpr double kFlat = 1e-6;

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// The boundary of some triangles of a closed surface, as a ring of vertices.
std::vector<std::uint32_t> rim_of(const Mesh& hull, const std::vector<std::size_t>& triangles) {
  std::map<std::uint32_t, std::uint32_t> next;
  std::vector<Edge> edges;
  for (const std::size_t t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) edges.emplace_back(hull.triangles[t][k], hull.triangles[t][(k + 1) % 3]);
  }
  std::sort(edges.begin(), edges.end());
  for (const Edge& e : edges) {
    if (!std::binary_search(edges.begin(), edges.end(), Edge(e.second, e.first))) next[e.first] = e.second;
  }
  std::vector<std::uint32_t> ring;
  if (next.empty()) return ring;
  const std::uint32_t begin = next.begin()->first;
  std::uint32_t at = begin;
  do {
    ring.push_back(at);
    const auto found = next.find(at);
    if (found == next.end()) break;
    at = found->second;
  } while (at != begin && ring.size() <= next.size());
  return ring;
}

}  // namespace

std::uint32_t Convex::farthest(const Vec3& direction) const {
  std::uint32_t best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < vertices.size(); ++i) {
    const double along = vertices[i].dot(direction);
    if (along > most) {
      most = along;
      best = i;
    }
  }
  return best;
}

Vec3 Convex::support(const Vec3& direction) const {
  switch (core) {
    case Core::point:
      return Vec3::Zero();
    case Core::segment:
      return {0.0, 0.0, std::copysign(half_length, direction.z())};
    case Core::cylinder: {
      const double across = std::hypot(direction.x(), direction.y());
      const double part = across > 0.0 ? disc_radius / across : 0.0;
      return {part * direction.x(), part * direction.y(), std::copysign(half_length, direction.z())};
    }
    case Core::polyhedron:
      return vertices[farthest(direction)];
  }
  return Vec3::Zero();
}

ConvexStorage::ConvexStorage(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      convex_.core = Convex::Core::point;
      convex_.radius = convex_.inner_radius = convex_.outer_radius = shape.radius;
      break;
    case ShapeKind::capsule:
      convex_.core = Convex::Core::segment;
      convex_.radius = convex_.inner_radius = shape.radius;
      convex_.half_length = shape.half_length;
      convex_.outer_radius = shape.radius + shape.half_length;
      break;
    case ShapeKind::cylinder:
      convex_.core = Convex::Core::cylinder;
      convex_.disc_radius = shape.radius;
      convex_.half_length = shape.half_length;
      convex_.inner_radius = std::min(shape.radius, shape.half_length);
      convex_.outer_radius = std::hypot(shape.radius, shape.half_length);
      faces_ = {{Vec3::UnitZ(), shape.half_length}, {-Vec3::UnitZ(), shape.half_length}};
      convex_.faces = faces_;
      break;
    default:
      add_box(shape.half_extents);
      break;
  }
}

ConvexStorage::ConvexStorage(double outer_radius, double inner_radius) {
  convex_.core = Convex::Core::point;
  convex_.radius = convex_.outer_radius = outer_radius;
  convex_.inner_radius = inner_radius;
}

ConvexStorage::ConvexStorage(const Mesh& mesh) {
  const Mesh hull = convex_hull(mesh);
  if (hull.triangles.empty()) {
    Box bounds{Vec3::Constant(1e30), Vec3::Constant(-1e30)};
    for (const Vec3& v : mesh.vertices) bounds.extend({v, v});
    add_box(0.5 * (bounds.upper - bounds.lower));
    for (Vec3& v : vertices_) v += 0.5 * (bounds.upper + bounds.lower);
    finish_polyhedron();
    return;
  }
  vertices_ = hull.vertices;
  double size = 0.0;
  for (const Vec3& v : vertices_) size = std::max(size, (v - vertices_[0]).norm());

  struct Side {
    Vec3 normal;
    double area;
  };
  std::vector<Side> sides;
  std::map<Edge, std::size_t> owner;
  std::vector<std::size_t> order;
  for (std::size_t t = 0; t < hull.triangles.size(); ++t) {
    const auto& [a, b, c] = hull.triangles[t];
    const Vec3 twice = (vertices_[b] - vertices_[a]).cross(vertices_[c] - vertices_[a]);
    sides.push_back({twice.normalized(), twice.norm()});
    for (const Edge& e : {Edge(a, b), Edge(b, c), Edge(c, a)}) owner[e] = t;
    order.push_back(t);
  }
  // Large triangles determine a plane most exactly.
  std::stable_sort(order.begin(), order.end(), [&](auto i, auto j) { return sides[i].area > sides[j].area; });
  std::vector<bool> taken(sides.size(), false);
  for (const std::size_t seed : order) {
    if (taken[seed]) continue;
    const Vec3 normal = sides[seed].normal;
    const double offset = normal.dot(vertices_[hull.triangles[seed][0]]);
    std::vector<std::size_t> members{seed};
    taken[seed] = true;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const auto& corners = hull.triangles[members[i]];
      for (std::size_t k = 0; k < 3; ++k) {
        const auto found = owner.find(Edge(corners[(k + 1) % 3], corners[k]));
        if (found == owner.end() || taken[found->second]) continue;
        const auto& other = hull.triangles[found->second];
        const bool flat = std::all_of(other.begin(), other.end(), [&](std::uint32_t v) {
          return std::abs(normal.dot(vertices_[v]) - offset) <= kFlat * size;
        });
        if (!flat) continue;
        taken[found->second] = true;
        members.push_back(found->second);
      }
    }
    const std::vector<std::uint32_t> ring = rim_of(hull, members);
    if (ring.size() < 3) continue;
    faces_.push_back(
        {normal, offset, static_cast<std::uint32_t>(rings_.size()), static_cast<std::uint32_t>(ring.size())});
    rings_.insert(rings_.end(), ring.begin(), ring.end());
  }
  finish_polyhedron();
}

void ConvexStorage::add_box(const Vec3& half) {
  for (int i = 0; i < 8; ++i) {
    vertices_.push_back(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).cwiseProduct(half));
  }
  constexpr std::uint32_t kRings[6][4] = {{1, 3, 7, 5}, {0, 4, 6, 2}, {2, 6, 7, 3},
                                          {0, 1, 5, 4}, {4, 5, 7, 6}, {0, 2, 3, 1}};
  for (int f = 0; f < 6; ++f) {
    Vec3 normal = Vec3::Zero();
    normal[f / 2] = f % 2 == 0 ? 1.0 : -1.0;
    faces_.push_back({normal, half[f / 2], static_cast<std::uint32_t>(rings_.size()), 4});
    rings_.insert(rings_.end(), std::begin(kRings[f]), std::end(kRings[f]));
  }
  finish_polyhedron();
}

void ConvexStorage::finish_polyhedron() {
  convex_.core = Convex::Core::polyhedron;
  std::vector<std::vector<std::uint32_t>> of(vertices_.size());
  for (std::uint32_t f = 0; f < faces_.size(); ++f) {
    for (std::uint32_t k = 0; k < faces_[f].corners; ++k) of[rings_[faces_[f].first + k]].push_back(f);
  }
  faces_of_.clear();
  first_of_.assign(1, 0);
  convex_.centre = Vec3::Zero();
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    faces_of_.insert(faces_of_.end(), of[i].begin(), of[i].end());
    first_of_.push_back(static_cast<std::uint32_t>(faces_of_.size()));
    convex_.centre += vertices_[i] / static_cast<double>(vertices_.size());
    convex_.outer_radius = std::max(convex_.outer_radius, vertices_[i].norm());
  }
  convex_.inner_radius = std::numeric_limits<double>::infinity();
  for (ConvexFace& f : faces_) {
    f.offset = f.normal.dot(vertices_[rings_[f.first]]);
    convex_.inner_radius = std::min(convex_.inner_radius, f.offset - f.normal.dot(convex_.centre));
  }
  convex_.vertices = vertices_;
  convex_.faces = faces_;
  convex_.rings = rings_;
  convex_.faces_of = faces_of_;
  convex_.first_of = first_of_;
}

ConvexTriangle::ConvexTriangle(const Vec3& a, const Vec3& b, const Vec3& c) : vertices_{a, b, c} {
  static constexpr std::uint32_t kRings[] = {0, 1, 2, 0, 2, 1};
  static constexpr std::uint32_t kFacesOf[] = {0, 1, 0, 1, 0, 1};
  static constexpr std::uint32_t kFirstOf[] = {0, 2, 4, 6};
  const Vec3 twice = (b - a).cross(c - a);
  const double area = twice.norm();
  const Vec3 normal = area > 0.0 ? Vec3(twice / area) : Vec3::Zero();
  faces_ = {{{normal, normal.dot(a), 0, 3}, {-normal, -normal.dot(a), 3, 3}}};
  convex_.core = Convex::Core::polyhedron;
  convex_.centre = (a + b + c) / 3.0;
  convex_.outer_radius = std::sqrt(std::max({a.squaredNorm(), b.squaredNorm(), c.squaredNorm()}));
  convex_.vertices = vertices_;
  if (area > 0.0) convex_.faces = faces_;
  convex_.rings = kRings;
  convex_.faces_of = kFacesOf;
  convex_.first_of = kFirstOf;
}

}  // namespace subworld::bullet
