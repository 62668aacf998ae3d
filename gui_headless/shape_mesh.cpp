#include "shape_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace subworld {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

// Faces that meet at a smaller angle are shaded as one smooth surface, without an edge line.
const double kCreaseCosine = std::cos(35.0 * std::numbers::pi / 180.0);

struct Surface {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;

  std::uint32_t add(const Vec3& vertex) {
    vertices.push_back(vertex);
    return static_cast<std::uint32_t>(vertices.size() - 1);
  }
};

std::array<float, 3> to_float(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

std::vector<Vec3> area_normals(const Surface& surface) {
  std::vector<Vec3> normals;
  normals.reserve(surface.triangles.size());
  for (const auto& t : surface.triangles) {
    const Vec3& a = surface.vertices[t[0]];
    normals.push_back((surface.vertices[t[1]] - a).cross(surface.vertices[t[2]] - a));
  }
  return normals;
}

// The triangles around each vertex.
std::vector<std::vector<std::uint32_t>> fans(const Surface& surface) {
  std::vector<std::vector<std::uint32_t>> fans(surface.vertices.size());
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    for (const auto v : surface.triangles[t]) fans[v].push_back(t);
  }
  return fans;
}

bool has_corner(const Triangle& t, std::uint32_t vertex) { return std::ranges::find(t, vertex) != t.end(); }

// Converts a surface of shared vertices to shaded triangles: normals are smooth up to the crease angle; sharper edges
// are marked.
ShapeMesh shade(const Surface& surface) {
  const auto areas = area_normals(surface);
  const auto around = fans(surface);
  const auto smooth = [&](std::uint32_t a, std::uint32_t b) {
    return areas[a].dot(areas[b]) >= kCreaseCosine * areas[a].norm() * areas[b].norm();
  };
  ShapeMesh mesh;
  mesh.reserve(3 * surface.triangles.size());
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    const auto& corners = surface.triangles[t];
    std::array<bool, 3> sharp{true, true, true};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto from = corners[(i + 1) % 3];
      const auto to = corners[(i + 2) % 3];
      for (const auto other : around[from]) {
        if (other != t && has_corner(surface.triangles[other], to) && smooth(t, other)) sharp[i] = false;
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      Vec3 normal = Vec3::Zero();
      for (const auto other : around[corners[i]]) {
        if (smooth(t, other)) normal += areas[other];
      }
      MeshVertex vertex;
      vertex.position = to_float(surface.vertices[corners[i]]);
      vertex.normal = to_float(normal.normalized());
      for (std::size_t k = 0; k < 3; ++k) vertex.edge[k] = sharp[k] && k != i ? 0.0F : 1.0F;
      mesh.push_back(vertex);
    }
  }
  return mesh;
}

struct Ring {
  double radius;
  double z;
};

// A solid of revolution about z. The rings are in upward order; one of radius 0 is a tip.
Surface revolve(const std::vector<Ring>& rings, int segments) {
  Surface surface;
  std::vector<std::vector<std::uint32_t>> columns;
  for (const auto& ring : rings) {
    std::vector<std::uint32_t> row(static_cast<std::size_t>(segments));
    if (ring.radius == 0.0) {
      std::ranges::fill(row, surface.add({0.0, 0.0, ring.z}));
    } else {
      for (int s = 0; s < segments; ++s) {
        const double angle = 2.0 * std::numbers::pi * s / segments;
        row[s] = surface.add({ring.radius * std::cos(angle), ring.radius * std::sin(angle), ring.z});
      }
    }
    columns.push_back(std::move(row));
  }
  for (std::size_t k = 0; k + 1 < columns.size(); ++k) {
    for (std::size_t s = 0; s < columns[k].size(); ++s) {
      const std::size_t next = (s + 1) % columns[k].size();
      const auto a = columns[k][s];
      const auto b = columns[k][next];
      const auto c = columns[k + 1][next];
      const auto d = columns[k + 1][s];
      if (a != b) surface.triangles.push_back({a, b, c});
      if (c != d) surface.triangles.push_back({a, c, d});
    }
  }
  return surface;
}

// Rings of a half sphere of radius 1 with its pole at z = sign, in upward order, moved by `shift`.
std::vector<Ring> half_sphere(int steps, double sign, double shift) {
  std::vector<Ring> rings;
  for (int k = 0; k <= steps; ++k) {
    const double angle = 0.5 * std::numbers::pi * k / steps;  // from the pole
    rings.push_back({k == 0 ? 0.0 : std::sin(angle), sign * std::cos(angle) + shift});
  }
  if (sign > 0.0) std::ranges::reverse(rings);
  return rings;
}

bool finite_triangle(const Triangle& t, const std::vector<Vec3>& vertices) {
  return std::ranges::all_of(t, [&](auto v) { return v < vertices.size() && vertices[v].allFinite(); });
}

}  // namespace

ShapeMesh box_mesh() {
  Surface surface;
  for (int corner = 0; corner < 8; ++corner) {
    surface.add({(corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0, (corner & 4) != 0 ? 1.0 : -1.0});
  }
  surface.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return shade(surface);
}

ShapeMesh sphere_mesh(int segments) {
  auto rings = half_sphere(segments / 4, -1.0, 0.0);
  rings.pop_back();
  for (const auto& ring : half_sphere(segments / 4, 1.0, 0.0)) rings.push_back(ring);
  return shade(revolve(rings, segments));
}

ShapeMesh cylinder_mesh(int segments) {
  return shade(revolve({{0.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {0.0, 1.0}}, segments));
}

ShapeMesh cone_mesh(int segments) { return shade(revolve({{0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}}, segments)); }

ShapeMesh capsule_mesh(int segments) {
  auto rings = half_sphere(segments / 4, -1.0, -1.0);
  for (const auto& ring : half_sphere(segments / 4, 1.0, 1.0)) rings.push_back(ring);
  auto mesh = shade(revolve(rings, segments));
  for (auto& vertex : mesh) {
    vertex.stretch = vertex.position[2] > 0.0F ? 1.0F : -1.0F;
    vertex.position[2] -= vertex.stretch;
  }
  return mesh;
}

ShapeMesh file_mesh(const Mesh& mesh) {
  const auto before = [](const Vec3& a, const Vec3& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::map<Vec3, std::uint32_t, decltype(before)> welded(before);
  Surface surface;
  for (const auto& triangle : mesh.triangles) {
    if (!finite_triangle(triangle, mesh.vertices)) continue;
    Triangle corners{};
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& vertex = mesh.vertices[triangle[i]];
      const auto [known, is_new] = welded.try_emplace(vertex, static_cast<std::uint32_t>(surface.vertices.size()));
      if (is_new) surface.add(vertex);
      corners[i] = known->second;
    }
    const Vec3& a = surface.vertices[corners[0]];
    const Vec3 area = (surface.vertices[corners[1]] - a).cross(surface.vertices[corners[2]] - a);
    if (area.squaredNorm() > 0.0) surface.triangles.push_back(corners);
  }
  return shade(surface);
}

}  // namespace subworld
