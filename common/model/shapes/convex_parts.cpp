#include "model/shapes/convex_parts.hpp"

#include "model/shapes/mass_properties.hpp"
#include "model/shapes/solid_distance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

// A piece is the solid within a cell, the intersection of half-spaces. Its hull is that of three kinds of points: of
// the surface's triangles, clipped by the planes of the cell, and the cell's corners inside the solid. So no cut needs
// a cap. The piece whose hull is farthest from the solid (the gap) is cut next, by that plane at the gap after which
// the two hulls have the least volume. At the end, parts are joined where the common hull is convex enough. Concavity
// is a length, as in Lien and Amato 2007. Libraries were measured, see common/model/README.md.

namespace subworld {

namespace {

constexpr std::size_t kPlanes = 24;    ///< planes of faces that are tried for a cut
constexpr int kSlices = 2;             ///< planes across an axis on each side of the gap
constexpr double kTouch = 1.5;         ///< a plane that far from the gap, in radii, passes it
constexpr std::size_t kSamples = 600;  ///< points of a hull, and of the surface for each part
constexpr double kFavour = 1.05;       ///< of planes of faces over slices, in volume
constexpr double kLeastShare = 0.03;   ///< of the volume on one side of a cut: less shaves a piece and leaves its gap
constexpr int kMostFutile = 2;         ///< then a piece is halved: no plane alone helps a ring
constexpr double kSameError = 0.8;     ///< of the error before
constexpr double kMostExtra = 0.3;     ///< volume that joining two parts may add
constexpr double kThin = 1e-7;         ///< of the extent: a point that near to a plane is on it
constexpr double kRounding = 1e-5;     ///< of planes that are one, of 1 and of the extent
constexpr double kReflex = 1e-3;       ///< sine of the least angle of a reflex edge

struct Piece {
  std::vector<Plane> cell;  ///< the solid is below each
  std::vector<Corners> surface;
  std::vector<Vec3> inner;  ///< corners of the cell inside the solid
  Mesh hull;
  double error_m = 0.0;     ///< largest distance of a point of the hull from the solid
  Vec3 gap = Vec3::Zero();  ///< that point
  int futile = 0;           ///< cuts in a row that left the error as it was
};

Box bounds(const Mesh& mesh) {
  Box box{mesh.vertices[0], mesh.vertices[0]};
  for (const Vec3& v : mesh.vertices) box.extend({v, v});
  return box;
}

class Divider {
 public:
  Divider(const Mesh& mesh, double concavity_m) : mesh_(mesh), distance_(mesh), concavity_m_(concavity_m) {
    box_ = bounds(mesh);
    thin_m_ = kThin * (box_.upper - box_.lower).norm();
    find_reflex_edges();
  }

  [[nodiscard]] Piece whole() const {
    Piece piece;
    for (int axis = 0; axis < 3; ++axis) {
      piece.cell.push_back({Vec3::Unit(axis), box_.upper[axis] + 10.0 * thin_m_});
      piece.cell.push_back({-Vec3::Unit(axis), -box_.lower[axis] + 10.0 * thin_m_});
    }
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) piece.surface.push_back(corners(mesh_, i));
    measure(piece);
    return piece;
  }

  /// Divides the piece that is farthest from convex, until all are convex enough or as many as may be.
  void divide(std::vector<Piece>& pieces, std::size_t most) const {
    while (pieces.size() < most) {
      const auto worst = std::ranges::max_element(
          pieces, {}, [](const Piece& piece) { return piece.surface.empty() ? 0.0 : piece.error_m; });
      if (!(worst->error_m > concavity_m_) || worst->surface.empty()) return;
      if (auto both = divided(*worst)) {
        *worst = std::move(both->first);
        pieces.push_back(std::move(both->second));
      } else {
        worst->surface.clear();  // it stays as it is
      }
    }
  }

  /// The pieces below and above the best plane; none if no plane divides it.
  [[nodiscard]] std::optional<std::pair<Piece, Piece>> divided(const Piece& piece) const {
    const bool futile = piece.futile >= kMostFutile;
    for (const bool halves : {futile, !futile}) {
      const std::optional<Plane> plane = halves ? middle(piece) : best_plane(piece);
      if (!plane) continue;
      std::pair<Piece, Piece> both{below(piece, *plane), below(piece, {-plane->normal, -plane->offset})};
      for (Piece* part : {&both.first, &both.second}) {
        measure(*part);
        part->futile = part->error_m > kSameError * piece.error_m ? piece.futile + 1 : 0;
      }
      if (!both.first.hull.triangles.empty() && !both.second.hull.triangles.empty()) return both;
    }
    return std::nullopt;
  }
  /// Across the longest side.
  [[nodiscard]] static Plane middle(const Piece& piece) {
    const Box box = bounds(piece.hull);
    Eigen::Index longest = 0;
    (box.upper - box.lower).maxCoeff(&longest);
    return {Vec3::Unit(longest), 0.5 * (box.lower + box.upper)[longest]};
  }
  [[nodiscard]] std::optional<Plane> best_plane(const Piece& piece) const {
    std::optional<Plane> best;
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [plane, is_face] : planes_for(piece)) {
      const auto [below, above] = hull_volumes(piece, plane);
      const double cost = (below + above) * (is_face ? 1.0 : kFavour);
      if (!(std::min(below, above) > kLeastShare * (below + above)) || !(cost < (1.0 - 1e-9) * least)) continue;
      least = cost;
      best = plane;
    }
    return best;
  }

  /// Joins pairs whose common hull is convex enough, those first that add least volume. Returns whether there were any.
  bool join(std::vector<Piece>& pieces) const {
    std::set<std::tuple<double, std::size_t, std::size_t>> pairs;
    std::vector<bool> gone(pieces.size());
    const auto add_pairs = [&](std::size_t a) {
      for (std::size_t b = 0; b < a; ++b) {
        if (gone[b] || !bounds(pieces[a].hull).grown(thin_m_).meets(bounds(pieces[b].hull))) continue;
        const double apart = integrate(pieces[a].hull).volume + integrate(pieces[b].hull).volume;
        const double extra = integrate(common_hull(pieces[a], pieces[b])).volume - apart;
        if (extra < kMostExtra * apart) pairs.emplace(extra, a, b);
      }
    };
    for (std::size_t a = 0; a < pieces.size(); ++a) add_pairs(a);
    while (!pairs.empty()) {
      const auto [extra, a, b] = *pairs.begin();
      pairs.erase(pairs.begin());
      if (gone[a] || gone[b]) continue;
      Piece both;
      both.hull = common_hull(pieces[a], pieces[b]);
      find_gap(both, concavity_m_);
      if (both.error_m > concavity_m_) continue;
      gone[a] = gone[b] = true;
      gone.push_back(false);
      pieces.push_back(std::move(both));
      add_pairs(pieces.size() - 1);
    }
    std::size_t i = 0;
    return std::erase_if(pieces, [&](const Piece&) { return gone[i++]; }) > 0;
  }

 private:
  struct ReflexEdge {
    Vec3 middle;
    std::array<std::size_t, 2> faces;  ///< indices into `planes_`
    double weight;
  };

  void find_reflex_edges() {
    std::map<std::array<std::int64_t, 4>, std::size_t> known;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> sides;
    const double extent = (box_.upper - box_.lower).norm();
    const auto plane_of = [&](std::size_t i) {
      const Vec3 normal = crossed(corners(mesh_, i)).normalized();
      const double offset = normal.dot(mesh_.vertices[mesh_.triangles[i][0]]);
      const Eigen::Vector4d rough = Eigen::Vector4d(normal.x(), normal.y(), normal.z(), offset / extent) / kRounding;
      const auto [at, added] = known.try_emplace(
          {std::llround(rough[0]), std::llround(rough[1]), std::llround(rough[2]), std::llround(rough[3])},
          planes_.size());
      if (added) planes_.push_back({normal, offset});
      return at->second;
    };
    for (std::size_t i = 0; i < mesh_.triangles.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k) sides[{mesh_.triangles[i][k], mesh_.triangles[i][(k + 1) % 3]}] = i;
    for (const auto& [edge, face] : sides) {
      const auto other = sides.find({edge.second, edge.first});
      if (edge.first > edge.second || other == sides.end()) continue;
      const Vec3 a = crossed(corners(mesh_, face)), b = crossed(corners(mesh_, other->second));
      const Vec3 along = mesh_.vertices[edge.second] - mesh_.vertices[edge.first];
      const double turn = a.cross(b).dot(along) / (a.norm() * b.norm() * along.norm());
      if (!(turn < -kReflex)) continue;
      edges_.push_back({mesh_.vertices[edge.first] + 0.5 * along,
                        {plane_of(face), plane_of(other->second)},
                        along.norm() * (1.0 - a.normalized().dot(b.normalized()))});
    }
  }

  /// Without those that are nearly equal.
  [[nodiscard]] std::vector<Vec3> welded(std::vector<Vec3> points) const {
    const auto cell = [&](const Vec3& p) {
      return std::array{std::llround(p.x() / thin_m_), std::llround(p.y() / thin_m_), std::llround(p.z() / thin_m_)};
    };
    std::ranges::sort(points, {}, cell);
    const auto rest = std::ranges::unique(points, {}, cell);
    points.erase(rest.begin(), rest.end());
    return points;
  }

  void measure(Piece& piece) const {
    std::vector<Vec3> points = piece.inner;
    for (const Corners& t : piece.surface) points.insert(points.end(), t.begin(), t.end());
    piece.hull = hull_near(welded(std::move(points)), 0.25 * concavity_m_);
    find_gap(piece, std::numeric_limits<double>::infinity());
  }

  [[nodiscard]] Mesh common_hull(const Piece& a, const Piece& b) const {
    std::vector<Vec3> points = a.hull.vertices;
    points.insert(points.end(), b.hull.vertices.begin(), b.hull.vertices.end());
    return hull_near(welded(std::move(points)), thin_m_);
  }

  void find_gap(Piece& piece, double enough_m) const {
    for (const Vec3& p : samples(piece.hull, kSamples, true)) {
      const double m = distance_.outside_m(p, piece.error_m);
      if (m > piece.error_m) piece.error_m = m, piece.gap = p;
      if (piece.error_m > enough_m) return;
    }
  }

  /// Faces at reflex edges within the cell, the longest first and then some of all; and slices across the axes.
  [[nodiscard]] std::vector<std::pair<Plane, bool>> planes_for(const Piece& piece) const {
    std::map<std::size_t, double> weights;
    for (const ReflexEdge& edge : edges_) {
      if (!std::ranges::all_of(piece.cell, [&](const Plane& side) { return side.height(edge.middle) < -thin_m_; }))
        continue;
      for (const std::size_t face : edge.faces)
        if (std::abs(planes_[face].height(piece.gap)) <= kTouch * piece.error_m) weights[face] += edge.weight;
    }
    std::vector<std::pair<double, std::size_t>> order;
    for (const auto& [face, weight] : weights) order.emplace_back(-weight, face);
    std::ranges::sort(order);
    std::vector<std::pair<Plane, bool>> planes;
    const std::size_t first = std::min(order.size(), kPlanes / 2), stride = 1 + 2 * (order.size() - first) / kPlanes;
    for (std::size_t i = 0; i < order.size(); i += i < first ? 1 : stride)
      planes.emplace_back(planes_[order[i].second], true);
    for (int axis = 0; axis < 3; ++axis)
      for (int i = -kSlices; i <= kSlices; ++i)
        planes.push_back({{Vec3::Unit(axis), piece.gap[axis] + piece.error_m * i / kSlices}, false});
    return planes;
  }

  /// The points where the plane meets two planes of the cell, inside the solid.
  [[nodiscard]] std::vector<Vec3> inner_corners(const Piece& piece, const Plane& plane) const {
    std::vector<Vec3> inner;
    for (std::size_t i = 0; i < piece.cell.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Plane &a = piece.cell[i], &b = piece.cell[j];
        const Vec3 line = a.normal.cross(b.normal);
        const double slope = line.dot(plane.normal);
        if (std::abs(slope) < 1e-6) continue;
        const Vec3 at =
            (plane.offset * line + a.offset * b.normal.cross(plane.normal) + b.offset * plane.normal.cross(a.normal)) /
            slope;
        if (std::ranges::any_of(piece.cell, [&](const Plane& side) { return side.height(at) > thin_m_; })) continue;
        if (distance_.winding(at) > 0.75) inner.push_back(at);
      }
    }
    return inner;
  }

  /// The triangle's part below the plane: up to four corners. One in the plane belongs to the side of its solid.
  [[nodiscard]] std::vector<Vec3> clipped(const Corners& t, const Plane& plane) const {
    std::array<double, 3> height{};
    for (std::size_t i = 0; i < 3; ++i) {
      height[i] = plane.height(t[i]);
      if (std::abs(height[i]) <= thin_m_) height[i] = 0.0;
    }
    const auto [least, most] = std::ranges::minmax(height);
    if (least >= 0.0 && (most > 0.0 || crossed(t).dot(plane.normal) < 0.0)) return {};
    std::vector<Vec3> kept;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t next = (i + 1) % 3;
      if (height[i] <= 0.0) kept.push_back(t[i]);
      if (height[i] * height[next] < 0.0)
        kept.push_back(t[i] + (t[next] - t[i]) * (height[i] / (height[i] - height[next])));
    }
    return kept;
  }

  [[nodiscard]] Piece below(const Piece& piece, const Plane& plane) const {
    Piece part{.cell = piece.cell, .surface = {}, .inner = inner_corners(piece, plane), .hull = {}};
    for (const Vec3& at : piece.inner)
      if (plane.height(at) <= thin_m_) part.inner.push_back(at);
    part.cell.push_back(plane);
    for (const Corners& t : piece.surface) {
      const std::vector<Vec3> kept = clipped(t, plane);
      for (std::size_t i = 2; i < kept.size(); ++i) part.surface.push_back({kept[0], kept[i - 1], kept[i]});
    }
    return part;
  }

  [[nodiscard]] std::pair<double, double> hull_volumes(const Piece& piece, const Plane& plane) const {
    const std::vector<Vec3> on = inner_corners(piece, plane);
    std::array<double, 2> volumes{};
    for (const std::size_t side : {0U, 1U}) {
      const Plane towards{side == 0 ? plane.normal : Vec3(-plane.normal), side == 0 ? plane.offset : -plane.offset};
      std::vector<Vec3> points = on;
      for (const Vec3& at : piece.inner)
        if (towards.height(at) <= thin_m_) points.push_back(at);
      for (const Corners& t : piece.surface) {
        const std::vector<Vec3> kept = clipped(t, towards);
        points.insert(points.end(), kept.begin(), kept.end());
      }
      volumes[side] = integrate(hull_near(welded(std::move(points)), 0.5 * concavity_m_)).volume;
    }
    return {volumes[0], volumes[1]};
  }

  const Mesh& mesh_;
  SolidDistance distance_;
  double concavity_m_;
  double thin_m_ = 0.0;
  Box box_;
  std::vector<Plane> planes_;
  std::vector<ReflexEdge> edges_;
};

}  // namespace

ConvexParts convex_parts(const Mesh& closed, double concavity_m, std::size_t most_parts) {
  const Divider divider(closed, concavity_m);
  std::vector<Piece> pieces{divider.whole()};
  do divider.divide(pieces, most_parts);
  while (divider.join(pieces));
  ConvexParts result;
  for (Piece& piece : pieces) {
    result.error_m = std::max(result.error_m, piece.error_m);
    result.hulls.push_back(std::move(piece.hull));
  }
  result.error_m = std::max(result.error_m, uncovered_m(closed, result.hulls, kSamples));
  return result;
}

}  // namespace subworld
