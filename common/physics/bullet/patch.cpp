#include "patch.hpp"

#include "closest.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace subworld::bullet {

namespace {

/// Shapes without a rounded surface are drawn in before their nearest points are looked for, since the direction
/// between points that all but coincide is noise. If even so they overlap, they are drawn in further.
constexpr double kKept[] = {1.0, 0.95, 0.6, 0.2, 0.02};
constexpr double kBetterArea = 1.05;  ///< ratio: four points are chosen instead of those of the last step
constexpr double kParallel = 1e-4;    ///< edges closer to parallel (squared sine of their angle) touch along a line
constexpr int kDiscCorners = 8;       ///< of a cap that touches
constexpr int kDiscSides = 32;        ///< of a cap that is touched: half a percent larger than the disc at most
constexpr double kCap = 0.7;          ///< a cylinder whose axis is this near (cosine) to the normal touches by its cap
constexpr std::size_t kMostCorners = 64;
constexpr std::uint32_t kMostFaceCorners = 24;  ///< of a face with more, as many are taken all around it

/// Corners of the part of a surface that looks in a direction: a polygon, a line or a point.
struct Corner {
  Vec3 point;
  int feature = 0;
  int edge = 0;  ///< that starts here
};
class Corners {
 public:
  /// Where there is no room for one more, every second one goes: what is left still goes all around.
  void add(const Corner& corner) {
    if (count_ == kMostCorners) {
      count_ /= 2;
      for (std::size_t i = 1; i < count_; ++i) corners_[i] = corners_[2 * i];
    }
    corners_[count_++] = corner;
  }
  void clear() { count_ = 0; }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] Corner& operator[](std::size_t i) { return corners_[i]; }
  [[nodiscard]] const Corner& operator[](std::size_t i) const { return corners_[i]; }
  [[nodiscard]] const Corner* begin() const { return corners_.data(); }
  [[nodiscard]] const Corner* end() const { return corners_.data() + count_; }

  /// Leaves what is on the inner side of a plane with this outward normal.
  void cut(const Vec3& outwards, double offset, int number) {
    std::array<double, kMostCorners> out;
    bool any = false;
    for (std::size_t i = 0; i < count_; ++i) {
      out[i] = outwards.dot(corners_[i].point) - offset;
      any = any || out[i] > 0.0;
    }
    if (!any) return;
    const Corners whole = *this;
    const bool closed = whole.count_ > 2;
    count_ = 0;
    for (std::size_t i = 0; i < whole.count_; ++i) {
      if (out[i] <= 0.0) add(whole[i]);
      const std::size_t next = i + 1 < whole.count_ ? i + 1 : 0;
      if ((next == 0 && !closed) || (out[i] <= 0.0) == (out[next] <= 0.0)) continue;
      const double part = out[i] / (out[i] - out[next]);
      add({whole[i].point + part * (whole[next].point - whole[i].point), 64 * (1 + number) + whole[i].edge,
           out[i] <= 0.0 ? 64 * (1 + number) : whole[i].edge});
    }
  }

 private:
  std::array<Corner, kMostCorners> corners_;
  std::size_t count_ = 0;
};

Vec3 across(const Vec3& direction) {
  const Vec3 axis = std::abs(direction.x()) < 0.7 ? Vec3::UnitX() : Vec3::UnitY();
  return direction.cross(axis).normalized();
}

/// Corners of a cap, the first one where it is lowest along `down` if it is tilted by more than noise.
void add_disc(const Placed& s, const Vec3& down, double fine, Corners& out) {
  const Vec3 axis = s.turn.col(2), cap = std::copysign(1.0, axis.dot(down)) * axis;
  const Vec3 lean = down - down.dot(cap) * cap;
  const double drop = s.shape.disc_radius * lean.norm();  // of the rim below the centre
  const bool tilted = 0.08 * drop > fine;                 // 1 - cos(half a corner's angle)
  const Vec3 u = tilted ? Vec3(lean.normalized()) : across(cap);
  const Vec3 v = cap.cross(u);
  const Vec3 middle = s.at + s.shape.half_length * cap;
  for (int i = 0; i < kDiscCorners; ++i) {
    const double angle = 2.0 * M_PI * i / kDiscCorners;
    const double x = s.shape.disc_radius * std::cos(angle), y = s.shape.disc_radius * std::sin(angle);
    out.add({middle + x * u + y * v, i, i});
  }
}

/// The side of a cylinder that looks down.
void add_side(const Placed& s, const Vec3& down, Corners& out) {
  const Vec3 axis = s.turn.col(2);
  const Vec3 lean = down - down.dot(axis) * axis;
  const Vec3 rim = s.shape.disc_radius * lean.normalized();
  out.add({s.at + rim - s.shape.half_length * axis, 0, 0});
  out.add({s.at + rim + s.shape.half_length * axis, 1, 1});
}

void add_segment(const Placed& s, const Vec3& down, Corners& out) {
  const Vec3 half = s.shape.half_length * s.turn.col(2), rim = s.shape.radius * down;
  out.add({s.at + rim - half, 0, 0});
  out.add({s.at + rim + half, 1, 1});
}

/// The face of a polyhedron at its lowest vertex that looks down most.
std::uint32_t face_at(const Placed& s, std::uint32_t vertex, const Vec3& down) {
  const Vec3 local = s.turn.transpose() * down;
  std::uint32_t best = 0;
  double most = -2.0;
  for (std::uint32_t i = s.shape.first_of[vertex]; i < s.shape.first_of[vertex + 1]; ++i) {
    const double along = s.shape.faces[s.shape.faces_of[i]].normal.dot(local);
    if (along <= most) continue;
    most = along;
    best = s.shape.faces_of[i];
  }
  return best;
}

void add_face(const Placed& s, std::uint32_t number, Corners& out) {
  const ConvexFace& face = s.shape.faces[number];
  const std::uint32_t count = std::min(face.corners, kMostFaceCorners);
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t vertex = s.shape.rings[face.first + k * face.corners / count];
    const int name = static_cast<int>(vertex % 32);
    out.add({s.vertex(vertex), name, name});
  }
}

/// What a shape turns to a plane below it.
void add_lowest(const Placed& s, const Vec3& down, double fine, Corners& out) {
  switch (s.shape.core) {
    case Convex::Core::point:
      return out.add({s.at + s.shape.radius * down, 0, 0});
    case Convex::Core::segment:
      return add_segment(s, down, out);
    case Convex::Core::cylinder:
      if (std::abs(s.turn.col(2).dot(down)) > kCap) return add_disc(s, down, fine, out);
      return add_side(s, down, out);
    case Convex::Core::polyhedron: {
      const std::uint32_t vertex = s.shape.farthest(s.turn.transpose() * down);
      if (s.shape.faces.empty()) return add_face(s, 0, out);
      return add_face(s, face_at(s, vertex, down), out);
    }
  }
}

/// The edge at the lowest point whose other end is no more than `reach` higher, or the point alone.
void add_lowest_edge(const Placed& s, const Vec3& down, double reach, Corners& out) {
  const auto higher = [&](std::size_t one, std::size_t other) {
    return (out[one].point - out[other].point).dot(down) > reach;
  };
  switch (s.shape.core) {
    case Convex::Core::point:
      return out.add({s.at + s.shape.radius * down, 0, 0});
    case Convex::Core::segment:
    case Convex::Core::cylinder: {
      if (s.shape.core == Convex::Core::segment) {
        add_segment(s, down, out);
      } else {
        if (std::abs(s.turn.col(2).dot(down)) > kCap) return out.add({s.support(down), 2, 2});
        add_side(s, down, out);
      }
      if (higher(1, 0)) out[0] = out[1];
      if (out[0].feature == 1 || higher(0, 1)) {
        const Corner lowest = out[0];
        out.clear();
        out.add(lowest);
      }
      return;
    }
    case Convex::Core::polyhedron: {
      const Vec3 local = s.turn.transpose() * down;
      const std::uint32_t vertex = s.shape.farthest(local);
      const double lowest = s.shape.vertices[vertex].dot(local);
      double least = reach;
      std::optional<std::uint32_t> end;
      for (std::uint32_t i = s.shape.first_of[vertex]; i < s.shape.first_of[vertex + 1]; ++i) {
        if (s.shape.faces.empty()) break;
        const ConvexFace& face = s.shape.faces[s.shape.faces_of[i]];
        for (std::uint32_t k = 0; k < face.corners; ++k) {
          if (s.shape.rings[face.first + k] != vertex) continue;
          const std::uint32_t next = s.shape.rings[face.first + (k + 1) % face.corners];
          const double up = lowest - s.shape.vertices[next].dot(local);
          if (up > least) continue;
          least = up;
          end = next;
        }
      }
      // The lower number first, so that an edge is the same edge whichever end is lower.
      const std::uint32_t first = end ? std::min(vertex, *end) : vertex;
      out.add({s.vertex(first), static_cast<int>(first % 32), 0});
      if (end) {
        const std::uint32_t second = std::max(vertex, *end);
        out.add({s.vertex(second), static_cast<int>(second % 32), 0});
      }
      return;
    }
  }
}

/// Leaves what lies over a face.
void cut_by_face(const Placed& s, std::uint32_t number, Corners& corners) {
  const ConvexFace& face = s.shape.faces[number];
  if (face.corners == 0) {
    const Vec3 axis = s.turn.col(2), u = across(axis), v = axis.cross(u);
    for (int i = 0; i < kDiscSides && corners.size() > 0; ++i) {
      const double angle = 2.0 * M_PI * i / kDiscSides;
      const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
      corners.cut(out, s.shape.disc_radius * (1.0 + 1e-9) + out.dot(s.at), i);
    }
    return;
  }
  const Vec3 normal = s.face_normal(number);
  Vec3 from = s.vertex(s.shape.rings[face.first + face.corners - 1]);
  for (std::uint32_t k = 0; k < face.corners && corners.size() > 0; ++k) {
    const Vec3 to = s.vertex(s.shape.rings[face.first + k]);
    const Vec3 out = (to - from).cross(normal);
    corners.cut(out, out.dot(from), static_cast<int>(k % 64));
    from = to;
  }
}

bool lies_over(const Placed& s, std::uint32_t number, const Vec3& point) {
  const ConvexFace& face = s.shape.faces[number];
  if (face.corners == 0) {
    const Vec3 axis = s.turn.col(2), from = point - s.at;
    return (from - from.dot(axis) * axis).squaredNorm() <= s.shape.disc_radius * s.shape.disc_radius;
  }
  const Vec3 local = s.turn.transpose() * (point - s.at);
  Vec3 from = s.shape.vertices[s.shape.rings[face.first + face.corners - 1]];
  for (std::uint32_t k = 0; k < face.corners; ++k) {
    const Vec3& to = s.shape.vertices[s.shape.rings[face.first + k]];
    if ((to - from).cross(face.normal).dot(local - from) > 0.0) return false;
    from = to;
  }
  return true;
}

/// Points at a height over a plane, of which at most four are kept.
struct Found {
  Vec3 point;
  double height;
  int feature;
};

/// Leaves the points that four may be chosen from: those of the last step, the deepest, and the farthest in each of
/// some directions. All fours of many points would cost more than the rest of a step.
void thin(std::array<Found, kMostCorners>& found, std::size_t& count, const Vec3& normal, const PatchMemory& memory) {
  constexpr std::size_t kFew = 10;
  constexpr int kDirections = 8;
  if (count <= kFew) return;
  std::array<bool, kMostCorners> kept{};
  const auto keep_most = [&](const auto& of) {
    std::size_t most = 0;
    for (std::size_t i = 1; i < count; ++i) {
      if (of(found[i]) > of(found[most])) most = i;
    }
    kept[most] = true;
  };
  const Vec3 u = across(normal), v = normal.cross(u);
  for (int k = 0; k < kDirections; ++k) {
    const double angle = 2.0 * M_PI * k / kDirections;
    const Vec3 along = std::cos(angle) * u + std::sin(angle) * v;
    keep_most([&](const Found& f) { return along.dot(f.point); });
  }
  keep_most([](const Found& f) { return -f.height; });
  for (const int feature : memory.features) {
    const auto was = std::find_if(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count),
                                  [feature](const Found& f) { return f.feature == feature; });
    if (was != found.begin() + static_cast<std::ptrdiff_t>(count))
      kept[static_cast<std::size_t>(was - found.begin())] = true;
  }
  std::size_t left = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (kept[i]) found[left++] = found[i];
  }
  count = left;
}

/// Those of the last step unless others span a larger area or are deeper by `deeper`.
void reduce(std::array<Found, kMostCorners>& found, std::size_t& count, const Vec3& normal, double deeper,
            const PatchMemory& memory) {
  thin(found, count, normal, memory);
  if (count <= Patch::kMost) return;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) least = std::min(least, found[i].height);
  std::array<bool, kMostCorners> was, deep;
  for (std::size_t i = 0; i < count; ++i) {
    was[i] = std::find(memory.features.begin(), memory.features.end(), found[i].feature) != memory.features.end();
    deep[i] = found[i].height < least + deeper;
  }
  std::array<std::size_t, 4> best{0, 1, 2, 3}, f;
  double most = -1.0;
  for (f[0] = 0; f[0] < count; ++f[0]) {
    for (f[1] = f[0] + 1; f[1] < count; ++f[1]) {
      for (f[2] = f[1] + 1; f[2] < count; ++f[2]) {
        for (f[3] = f[2] + 1; f[3] < count; ++f[3]) {
          if (!deep[f[0]] && !deep[f[1]] && !deep[f[2]] && !deep[f[3]]) continue;
          const bool same = was[f[0]] && was[f[1]] && was[f[2]] && was[f[3]];
          const Vec3 one = found[f[2]].point - found[f[0]].point, other = found[f[3]].point - found[f[1]].point;
          const double area = std::abs(one.cross(other).dot(normal)) * (same ? kBetterArea : 1.0);
          if (area <= most) continue;
          most = area;
          best = f;
        }
      }
    }
  }
  for (std::size_t i = 0; i < Patch::kMost; ++i) found[i] = found[best[i]];
  count = Patch::kMost;
}

/// The points of `corners` below `reach` over a plane that belongs to b (`up` is the patch's normal) or to a.
Patch over_plane(const Corners& corners, const Vec3& up, double offset, bool of_a, int name, double reach, double fine,
                 PatchMemory& memory) {
  std::array<Found, kMostCorners> found;
  std::size_t count = 0;
  for (const Corner& c : corners) {
    const double height = up.dot(c.point) - offset;
    if (height <= reach) found[count++] = {c.point, height, 4096 * name + c.feature};
  }
  reduce(found, count, up, fine, memory);
  // Not around the ring: Gauss-Seidel with few iterations then leaves less. On a slope of 0.9 mu a cube's four points
  // creep by 0.0 to 0.3 mm in 5 s in this order (10 iterations, mu 0.5, steps of 1 ms), by 0.0 to 0.5 mm around it.
  if (count == Patch::kMost) {
    std::swap(found[0], found[2]);
    std::swap(found[1], found[3]);
    std::swap(found[2], found[3]);
  }
  Patch patch;
  patch.normal = of_a ? Vec3(-up) : up;
  memory.features.fill(-1);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [point, height, feature] = found[i];
    memory.features[i] = feature;
    patch.points[patch.count++] = {of_a ? point : Vec3(point - height * up), height, feature};
  }
  return patch;
}

/// What b's face carries of a, or a's of b.
Patch touch_face(const Placed& carrier, std::uint32_t face, const Placed& other, bool of_a, double reach, double fine,
                 PatchMemory& memory) {
  const Vec3 up = carrier.face_normal(face);
  Corners corners;
  add_lowest(other, -up, fine, corners);
  cut_by_face(carrier, face, corners);
  const int name = 2 * static_cast<int>(face % 4096) + (of_a ? 1 : 0);
  return over_plane(corners, up, carrier.face_offset(face), of_a, name, reach, fine, memory);
}

/// Neither shape touches with a face: two edges, an edge or a corner and something round.
Patch touch_edges(const Placed& a, const Placed& b, const Closest& near, Vec3 normal, double reach) {
  Corners of_a, of_b;
  add_lowest_edge(a, -normal, reach, of_a);
  add_lowest_edge(b, normal, reach, of_b);
  constexpr int kName = 1 << 24;
  Patch patch;
  patch.normal = normal;
  if (of_a.size() == 2 && of_b.size() == 2) {
    const Vec3 along_a = of_a[1].point - of_a[0].point, along_b = of_b[1].point - of_b[0].point;
    const Vec3 cross = along_a.cross(along_b);
    const double lengths = along_a.squaredNorm() * along_b.squaredNorm();
    const double square_a = along_a.squaredNorm(), square_b = along_b.squaredNorm();
    const Vec3 apart = of_a[0].point - of_b[0].point;
    if (cross.squaredNorm() < kParallel * lengths) {
      // The part that both have in common, by its place along b.
      const double at_0 = apart.dot(along_b) / square_b, at_1 = at_0 + along_a.dot(along_b) / square_b;
      const double low = std::max(0.0, std::min(at_0, at_1)), high = std::min(1.0, std::max(at_0, at_1));
      if (low <= high) {
        for (const double s : {low, high}) {
          const Vec3 on_b = of_b[0].point + s * along_b;
          const double t = std::clamp((on_b - of_a[0].point).dot(along_a) / square_a, 0.0, 1.0);
          const Vec3 on_a = of_a[0].point + t * along_a;
          const double distance = (on_a - on_b).dot(normal);
          const int feature = kName + (s == low ? 0 : 1);
          if (distance <= reach) patch.points[patch.count++] = {on_b, distance, feature};
          if (high - low < 1e-6) break;
        }
        if (patch.count > 0) return patch;
      }
    } else if (a.shape.radius == 0.0 && b.shape.radius == 0.0) {
      const Vec3 exact = std::copysign(1.0, cross.dot(normal)) * cross.normalized();
      if (exact.dot(normal) > 0.98) {
        const double mixed = along_a.dot(along_b);
        const double s = (apart.dot(along_b) * square_a - mixed * apart.dot(along_a)) / (lengths - mixed * mixed);
        patch.normal = exact;
        patch.points[patch.count++] = {of_b[0].point + std::clamp(s, 0.0, 1.0) * along_b, apart.dot(exact), kName + 2};
        return patch;
      }
    }
  }
  // The nearest points of cores that were drawn in, moved out to the surfaces.
  const double distance = -a.reach(-normal) - b.reach(normal);
  Vec3 on_b = near.on_b;
  on_b += (b.reach(normal) - on_b.dot(normal)) * normal;
  patch.points[patch.count++] = {on_b, distance, kName + 3};
  return patch;
}

struct Approach {
  Closest near;
  Vec3 normal;
  bool shallow = false;
};
/// The direction in which two shapes are nearest to each other.
Approach approach(const Placed& a, const Placed& b, const Vec3& guess) {
  const bool rounded = a.shape.radius > 0.0 || b.shape.radius > 0.0;
  for (std::size_t i = rounded ? 0 : 1; i < std::size(kKept); ++i) {
    // A point or a line is its own core. What has no inside (a triangle) stays whole.
    const auto kept = [&](const Placed& s) {
      return s.shape.radius > 0.0 || s.shape.inner_radius == 0.0 ? 1.0 : kKept[i];
    };
    const Closest near = closest(a, kept(a), b, kept(b), guess);
    if (!near.apart) continue;
    Closest out = near;
    // What is drawn in by a ratio is drawn out by it again.
    out.on_a = a.centre() + (near.on_a - a.centre()) / kept(a);
    out.on_b = b.centre() + (near.on_b - b.centre()) / kept(b);
    return {out, near.from_b.normalized(), i < 2};
  }
  Vec3 between = a.centre() - b.centre();
  if (between.squaredNorm() == 0.0) between = Vec3::UnitZ();
  return {{false, a.centre(), b.centre(), between}, between.normalized(), false};
}

struct FaceChoice {
  int face = -1;
  bool of_a = false;
  double gap = -std::numeric_limits<double>::infinity();
};

/// The face that separates best: of those that meet at the shapes' nearest vertices, or, of shapes deep in each other,
/// of all.
FaceChoice best_face(const Placed& a, const Placed& b, const Approach& way, const PatchMemory& memory, double better) {
  FaceChoice best;
  double best_rank = best.gap;
  const auto consider = [&](const Placed& carrier, const Placed& other, std::uint32_t face, bool of_a) {
    const Vec3 up = carrier.face_normal(face);
    if (!way.shallow && carrier.shape.inner_radius == 0.0 && (of_a ? -up : up).dot(way.normal) < 0.0) return;
    const double gap = -other.reach(-up) - carrier.face_offset(face);
    const bool was = memory.face == static_cast<int>(face) && memory.of_a == of_a;
    const double rank = gap + (was ? better : 0.0);
    if (rank <= best_rank) return;
    best_rank = rank;
    best = {static_cast<int>(face), of_a, gap};
  };
  for (const bool of_a : {false, true}) {
    const Placed &carrier = of_a ? a : b, &other = of_a ? b : a;
    const Convex& shape = carrier.shape;
    if (shape.faces.empty()) continue;
    const Vec3 down = of_a ? Vec3(-way.normal) : way.normal;
    if (!way.shallow) {
      for (std::uint32_t f = 0; f < shape.faces.size(); ++f) consider(carrier, other, f, of_a);
    } else if (shape.core == Convex::Core::cylinder) {
      consider(carrier, other, carrier.turn.col(2).dot(down) > 0.0 ? 0 : 1, of_a);
    } else {
      const std::uint32_t vertex = shape.farthest(carrier.turn.transpose() * down);
      consider(carrier, other, face_at(carrier, vertex, down), of_a);
    }
  }
  return best;
}

/// The face of the last step carries the patch as long as the other shape's deepest point lies over it.
bool still_carries(const Placed& a, const Placed& b, double reach, const PatchMemory& memory) {
  if (memory.face < 0) return false;
  const Placed &carrier = memory.of_a ? a : b, &other = memory.of_a ? b : a;
  if (carrier.shape.inner_radius == 0.0) return false;
  const auto face = static_cast<std::uint32_t>(memory.face);
  const Vec3 up = carrier.face_normal(face);
  const Vec3 lowest = other.support(-up);
  const double gap = up.dot(lowest) - other.shape.radius - carrier.face_offset(face);
  const double deep = 0.05 * std::min(carrier.shape.inner_radius, other.shape.inner_radius);
  return gap <= reach && gap > -deep && lies_over(carrier, face, lowest);
}

}  // namespace

Patch touch(const Placed& a, const Placed& b, double reach, double fine, PatchMemory& memory) {
  const auto apart_along = [&](const Vec3& normal) { return -a.reach(-normal) - b.reach(normal); };
  if (memory.separated && apart_along(memory.normal) > reach) return {};
  memory.separated = false;
  if (still_carries(a, b, reach, memory)) {
    const Placed &carrier = memory.of_a ? a : b, &other = memory.of_a ? b : a;
    const Patch patch =
        touch_face(carrier, static_cast<std::uint32_t>(memory.face), other, memory.of_a, reach, fine, memory);
    if (patch.count > 0) return patch;
  }
  const bool known = memory.normal.squaredNorm() > 0.0;
  const Approach way = approach(a, b, known ? memory.normal : Vec3(a.centre() - b.centre()));
  const double gap = apart_along(way.normal);
  memory.normal = way.normal;
  if (gap > reach) {
    memory.separated = true;
    memory.face = -1;
    return {};
  }
  const FaceChoice choice = best_face(a, b, way, memory, fine);
  if (choice.gap > reach) {
    memory.separated = true;
    memory.face = -1;
    const Vec3 up = (choice.of_a ? a : b).face_normal(static_cast<std::uint32_t>(choice.face));
    memory.normal = choice.of_a ? Vec3(-up) : up;
    return {};
  }
  // A shape that touches with a point needs no face to be held by.
  const bool point = choice.face >= 0 && (choice.of_a ? b : a).shape.core == Convex::Core::point;
  const double slack = point ? 0.0 : (memory.face >= 0 ? 2.0 : 1.0) * fine;
  if (choice.face >= 0 && choice.gap >= gap - slack) {
    const Placed &carrier = choice.of_a ? a : b, &other = choice.of_a ? b : a;
    const Patch patch =
        touch_face(carrier, static_cast<std::uint32_t>(choice.face), other, choice.of_a, reach, fine, memory);
    if (patch.count > 0) {
      memory.face = choice.face;
      memory.of_a = choice.of_a;
      memory.normal = patch.normal;
      return patch;
    }
  }
  memory.face = -1;
  return touch_edges(a, b, way.near, way.normal, reach);
}

Patch touch_plane(const Placed& a, const Vec3& normal, double offset, double reach, double fine, PatchMemory& memory) {
  if (-a.reach(-normal) - offset > reach) return {};
  Corners corners;
  add_lowest(a, -normal, fine, corners);
  return over_plane(corners, normal, offset, false, 0, reach, fine, memory);
}

Gap gap_between(const Placed& a, const Placed& b, const Vec3& guess) {
  const Approach way = approach(a, b, guess);
  const double high = b.reach(way.normal);
  Vec3 on_b = way.near.on_b;
  on_b += (high - on_b.dot(way.normal)) * way.normal;
  return {-a.reach(-way.normal) - high, way.normal, on_b};
}

}  // namespace subworld::bullet
