#include "physics/bullet/contacts/closest.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace subworld::bullet {

namespace {

constexpr int kMostRounds = 64;
constexpr double kRelative = 1e-13;  ///< of the squared distance: least improvement of an iteration
constexpr double kTouching = 1e-20;  ///< of the squared size: nearer cores overlap

/// Points of the difference of two cores, with the weight of each in the point nearest to the origin.
class Simplex {
 public:
  struct Corner {
    Vec3 w, on_a, on_b;
    double part = 0.0;
  };

  void add(const Vec3& on_a, const Vec3& on_b) { corners_[count_++] = {on_a - on_b, on_a, on_b, 0.0}; }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool has(const Vec3& w) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (corners_[i].w == w) return true;
    }
    return false;
  }

  /// Reduces to the corners that the nearest point needs. False if the origin is inside.
  bool reduce() {
    switch (count_) {
      case 1:
        corners_[0].part = 1.0;
        return true;
      case 2:
        keep(of_segment(0, 1));
        return true;
      case 3:
        keep(of_triangle(0, 1, 2));
        return true;
      default:
        return reduce_tetrahedron();
    }
  }

  [[nodiscard]] Vec3 nearest() const { return sum(&Corner::w); }
  [[nodiscard]] Vec3 on_a() const { return sum(&Corner::on_a); }
  [[nodiscard]] Vec3 on_b() const { return sum(&Corner::on_b); }
  [[nodiscard]] double largest() const {
    double most = 0.0;
    for (std::size_t i = 0; i < count_; ++i) most = std::max(most, corners_[i].w.squaredNorm());
    return most;
  }

 private:
  using Parts = std::array<double, 4>;

  [[nodiscard]] Vec3 sum(Vec3 Corner::*which) const {
    Vec3 total = Vec3::Zero();
    for (std::size_t i = 0; i < count_; ++i) total += corners_[i].part * (corners_[i].*which);
    return total;
  }
  [[nodiscard]] Vec3 point(const Parts& parts) const {
    Vec3 total = Vec3::Zero();
    for (std::size_t i = 0; i < count_; ++i) total += parts[i] * corners_[i].w;
    return total;
  }

  void keep(const Parts& parts) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if (!(parts[i] > 0.0)) continue;
      corners_[kept] = corners_[i];
      corners_[kept++].part = parts[i];
    }
    count_ = kept;
  }

  [[nodiscard]] Parts of_segment(std::size_t i, std::size_t j) const {
    const Vec3 &a = corners_[i].w, along = corners_[j].w - a;
    const double square = along.squaredNorm();
    const double t = square > 0.0 ? std::clamp(-a.dot(along) / square, 0.0, 1.0) : 0.0;
    Parts parts{};
    parts[i] = 1.0 - t;
    parts[j] = t;
    return parts;
  }

  /// By the Voronoi regions of a triangle (Ericson 2005, 5.1.5).
  [[nodiscard]] Parts of_triangle(std::size_t i, std::size_t j, std::size_t k) const {
    const Vec3 &a = corners_[i].w, &b = corners_[j].w, &c = corners_[k].w;
    const Vec3 ab = b - a, ac = c - a;
    const Vec3 normal = ab.cross(ac);
    const double square = normal.squaredNorm();
    if (square > 1e-24 * ab.squaredNorm() * ac.squaredNorm()) {
      const double u = b.cross(c).dot(normal), v = c.cross(a).dot(normal), w = a.cross(b).dot(normal);
      if (u > 0.0 && v > 0.0 && w > 0.0) {
        Parts parts{};
        const double all = u + v + w;
        parts[i] = u / all;
        parts[j] = v / all;
        parts[k] = w / all;
        return parts;
      }
    }
    Parts best = of_segment(i, j);
    double least = point(best).squaredNorm();
    for (const Parts& other : {of_segment(j, k), of_segment(k, i)}) {
      const double square_other = point(other).squaredNorm();
      if (square_other >= least) continue;
      least = square_other;
      best = other;
    }
    return best;
  }

  bool reduce_tetrahedron() {
    constexpr std::size_t kSides[4][4] = {{0, 1, 2, 3}, {0, 3, 1, 2}, {0, 2, 3, 1}, {1, 3, 2, 0}};
    bool outside = false;
    Parts best{};
    double least = 0.0;
    for (const auto& [i, j, k, opposite] : kSides) {
      const Vec3& a = corners_[i].w;
      const Vec3 normal = (corners_[j].w - a).cross(corners_[k].w - a);
      const double of_origin = -a.dot(normal), of_corner = (corners_[opposite].w - a).dot(normal);
      if (of_origin * of_corner > 0.0 && of_corner * of_corner > 1e-28 * normal.squaredNorm() * largest()) continue;
      const Parts parts = of_triangle(i, j, k);
      const double square = point(parts).squaredNorm();
      if (outside && square >= least) continue;
      outside = true;
      least = square;
      best = parts;
    }
    if (outside) keep(best);
    return outside;
  }

  std::array<Corner, 4> corners_;
  std::size_t count_ = 0;
};

}  // namespace

Closest closest(const Placed& a, double kept_a, const Placed& b, double kept_b, const Vec3& guess) {
  Simplex simplex;
  Vec3 v = guess;
  double square = 0.0;
  for (int round = 0; round < kMostRounds; ++round) {
    const Vec3 on_a = a.support(-v, kept_a), on_b = b.support(v, kept_b);
    const Vec3 w = on_a - on_b;
    if (round > 0 && (square - v.dot(w) <= kRelative * square || simplex.has(w))) break;
    const Simplex before = simplex;
    simplex.add(on_a, on_b);
    if (!simplex.reduce()) return {};
    const Vec3 next = simplex.nearest();
    const double next_square = next.squaredNorm();
    if (next_square <= kTouching * simplex.largest()) return {};
    if (round > 0 && next_square >= square) {  // only rounding is left
      simplex = before;
      break;
    }
    v = next;
    square = next_square;
  }
  return {true, simplex.on_a(), simplex.on_b(), v};
}

}  // namespace subworld::bullet
