#include "model/shapes/mass_properties.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace subworld {

namespace {

struct Face {
  std::array<std::uint32_t, 3> corners;
  Vec3 normal;  ///< unit; zero if the face has no area
  double offset;
  double doubt_m;  ///< a point closer to the plane may be on the other side of it
};

/// Incremental algorithm: starts with a tetrahedron; each vertex outside replaces the faces visible from it by a cone.
/// Which faces those are is decided exactly, on a grid of 2^-30 of the extent: rounding would tear holes into the hull
/// where many points are almost coplanar.
class HullBuilder {
 public:
  explicit HullBuilder(const std::vector<Vec3>& points) : points_(points) {}

  /// False if the points have no volume.
  bool build() {
    const auto start = tetrahedron();
    if (!start) return false;
    make_grid();
    const auto [a, b, c, d] = *start;
    for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}, std::array{a, d, b}, std::array{b, d, c}}) {
      // The four faces are oriented consistently, so one test is enough to turn all of them outwards.
      const bool outwards = (points_[b] - points_[a]).cross(points_[c] - points_[a]).dot(points_[d] - points_[a]) < 0.0;
      add(outwards ? corners : std::array{corners[0], corners[2], corners[1]});
    }
    for (std::uint32_t i = 0; i < points_.size(); ++i) insert(i);
    return true;
  }

  [[nodiscard]] const std::vector<Face>& faces() const { return faces_; }

 private:
  void add(const std::array<std::uint32_t, 3>& corners) {
    const Vec3& p = points_[corners[0]];
    Vec3 normal = (points_[corners[1]] - p).cross(points_[corners[2]] - p);
    const double length = normal.norm();
    normal = length > tolerance_ * tolerance_ ? Vec3(normal / length) : Vec3::Zero();
    faces_.push_back(
        {corners, normal, normal.dot(p), kGrid * spread_m_ * std::max(1.0, spread_m_ * spread_m_ / length)});
  }

  void make_grid() {
    Vec3 lower = points_[0], upper = points_[0];
    for (const Vec3& p : points_) {
      lower = lower.cwiseMin(p);
      upper = upper.cwiseMax(p);
    }
    const double cells_per_m = std::ldexp(1.0, 29) / (upper - lower).maxCoeff();
    grid_.reserve(points_.size());
    for (const Vec3& p : points_) {
      const Vec3 cell = cells_per_m * (p - 0.5 * (lower + upper));
      grid_.push_back({std::llround(cell.x()), std::llround(cell.y()), std::llround(cell.z())});
    }
  }

  /// Whether a point is on the outer side of a face, exactly.
  [[nodiscard]] bool is_outside(const Face& face, std::uint32_t point) const {
    const auto from = [&](std::uint32_t to) {
      std::array<Exact, 3> way{};
      for (std::size_t k = 0; k < 3; ++k) way[k] = grid_[to][k] - grid_[face.corners[0]][k];
      return way;
    };
    const auto a = from(face.corners[1]), b = from(face.corners[2]), p = from(point);
    return (a[1] * b[2] - a[2] * b[1]) * p[0] + (a[2] * b[0] - a[0] * b[2]) * p[1] +
               (a[0] * b[1] - a[1] * b[0]) * p[2] >
           0;
  }

  void insert(std::uint32_t i) {
    const auto height_m = [&](const Face& f) { return f.normal.dot(points_[i]) - f.offset; };
    if (std::ranges::none_of(faces_, [&](const Face& f) { return height_m(f) > tolerance_; })) return;
    const auto sees = [&](const Face& f) {
      const double m = height_m(f);
      return std::abs(m) > f.doubt_m ? m > 0.0 : is_outside(f, i);
    };
    // An edge of the visible faces that is passed in one direction only is on their rim.
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
    std::vector<Face> kept;
    for (const Face& f : faces_) {
      if (!sees(f)) {
        kept.push_back(f);
        continue;
      }
      for (std::size_t k = 0; k < 3; ++k) edges.insert({f.corners[k], f.corners[(k + 1) % 3]});
    }
    faces_ = std::move(kept);
    for (const auto& edge : edges) {
      if (!edges.contains({edge.second, edge.first})) add({edge.first, edge.second, i});
    }
  }

  /// Four vertices that are clearly not coplanar. Sets the tolerance from their spread.
  std::optional<std::array<std::uint32_t, 4>> tetrahedron() {
    if (points_.size() < 4) return std::nullopt;
    const auto farthest = [&](auto&& distance) {
      std::uint32_t best = 0;
      double most = -1.0;
      for (std::uint32_t i = 0; i < points_.size(); ++i) {
        const double d = distance(points_[i]);
        if (d > most) {
          most = d;
          best = i;
        }
      }
      return std::pair(best, most);
    };
    const std::uint32_t a = farthest([&](const Vec3& p) { return (p - points_[0]).norm(); }).first;
    const auto [b, spread] = farthest([&](const Vec3& p) { return (p - points_[a]).norm(); });
    spread_m_ = spread;
    tolerance_ = 1e-7 * spread;
    const Vec3 line = (points_[b] - points_[a]) / spread;
    const auto [c, width] = farthest([&](const Vec3& p) { return (p - points_[a]).cross(line).norm(); });
    if (!(width > 1e3 * tolerance_)) return std::nullopt;
    const Vec3 normal = line.cross(points_[c] - points_[a]).normalized();
    const auto [d, height] = farthest([&](const Vec3& p) { return std::abs((p - points_[a]).dot(normal)); });
    if (!(height > 1e3 * tolerance_)) return std::nullopt;
    return std::array{a, b, c, d};
  }

  using Exact = __int128;                ///< of 94 bits that a product of three ways has
  static constexpr double kGrid = 1e-8;  ///< of the spread: some cells

  const std::vector<Vec3>& points_;
  std::vector<std::array<std::int64_t, 3>> grid_;  ///< the points, in cells
  std::vector<Face> faces_;
  double spread_m_ = 0.0;
  double tolerance_ = 0.0;  // m
};

}  // namespace

Mesh convex_hull(const Mesh& mesh) {
  Mesh hull;
  hull.file = mesh.file;
  HullBuilder builder(mesh.vertices);
  if (!builder.build()) return hull;
  std::map<std::uint32_t, std::uint32_t> renumbered;
  for (const Face& face : builder.faces()) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [at, added] =
          renumbered.try_emplace(face.corners[k], static_cast<std::uint32_t>(hull.vertices.size()));
      if (added) hull.vertices.push_back(mesh.vertices[face.corners[k]]);
      triangle[k] = at->second;
    }
    hull.triangles.push_back(triangle);
  }
  return hull;
}

}  // namespace subworld
