#include "physics/bullet/contacts/patch.hpp"

#include "physics/bullet/contacts/closest.hpp"
#include "physics/bullet/contacts/contact_points.hpp"
#include "physics/bullet/contacts/corners.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld::bullet {

namespace {

/// Scale factors for shapes without a rounded surface. If the shapes overlap, or are so close that the direction
/// between their nearest points is noise, those of smaller shapes are used. Each factor is only a little smaller,
/// because the direction between scaled shapes is that of other features where they are long.
constexpr double kKept[] = {1.0, 0.998, 0.99, 0.95, 0.6, 0.2, 0.02};
constexpr double kLeastShallow = 0.95;
constexpr double kSure = 1e-4;  ///< of the smaller inner radius: the least distance of unscaled shapes with a direction
constexpr double kBetterPatchArea = 1.05;  ///< ratio: four points are chosen instead of those of the last step
constexpr double kParallelPatchEdges =
    1e-4;  ///< edges closer to parallel (squared sine of their angle) touch along a line

/// Points at a height over a plane, of which at most four are kept.
struct PatchCandidate {
  Vec3 point;
  double height;
  int feature;
};

/// Reduces the candidates for the four points: those of the last step, the deepest, and the farthest in each of some
/// directions. Testing all combinations of many points would cost more than the rest of a step.
void thin(std::array<PatchCandidate, kMostCorners>& found, std::size_t& count, const Vec3& normal,
          const PatchMemory& memory) {
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
    keep_most([&](const PatchCandidate& f) { return along.dot(f.point); });
  }
  keep_most([](const PatchCandidate& f) { return -f.height; });
  for (const int feature : memory.features) {
    const auto was = std::find_if(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count),
                                  [feature](const PatchCandidate& f) { return f.feature == feature; });
    if (was != found.begin() + static_cast<std::ptrdiff_t>(count))
      kept[static_cast<std::size_t>(was - found.begin())] = true;
  }
  std::size_t left = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (kept[i]) found[left++] = found[i];
  }
  count = left;
}

/// Keeps the points of the last step unless others span a larger area or are deeper by `deeper`.
void reduce(std::array<PatchCandidate, kMostCorners>& found, std::size_t& count, const Vec3& normal, double deeper,
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
  const auto area = [&](const Four& f) {
    const Vec3 one = found[f[2]].point - found[f[0]].point, other = found[f[3]].point - found[f[1]].point;
    return std::abs(one.cross(other).dot(normal));
  };
  const Four best = widest_four(count, was, deep, kBetterPatchArea, area);
  for (std::size_t i = 0; i < Patch::kMost; ++i) found[i] = found[best[i]];
  count = Patch::kMost;
}

/// The points of `corners` below `reach` over a plane that belongs to b (`up` is the patch's normal) or to a.
Patch over_plane(const Corners& corners, const Vec3& up, double offset, bool of_a, int name, double reach, double fine,
                 PatchMemory& memory) {
  std::array<PatchCandidate, kMostCorners> found;
  std::size_t count = 0;
  for (const Corner& c : corners) {
    const double height = up.dot(c.point) - offset;
    if (height <= reach) found[count++] = {c.point, height, 4096 * name + c.feature};
  }
  reduce(found, count, up, fine, memory);
  // Not in the order of the ring: with few iterations Gauss-Seidel then leaves a smaller error. On a slope of 0.9 mu a
  // cube's four points creep by 0.0 to 0.3 mm in 5 s in this order (10 iterations, mu 0.5, steps of 1 ms), by 0.0 to
  // 0.5 mm in the order of the ring.
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

/// Contacts of b's face with a, or of a's face with b.
Patch touch_face(const Placed& carrier, std::uint32_t face, const Placed& other, bool of_a, double reach, double fine,
                 PatchMemory& memory) {
  const Vec3 up = carrier.face_normal(face);
  Corners corners;
  add_lowest(other, -up, fine, corners);
  cut_by_face(carrier, face, corners);
  const int name = 2 * static_cast<int>(face % 4096) + (of_a ? 1 : 0);
  return over_plane(corners, up, carrier.face_offset(face), of_a, name, reach, fine, memory);
}

/// Neither shape touches with a face: two edges, or a round shape with an edge or a corner.
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
    if (cross.squaredNorm() < kParallelPatchEdges * lengths) {
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
  // The nearest points of the scaled cores, moved to the surfaces.
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
  const auto [small_m, large_m] = std::minmax(a.shape.inner_radius, b.shape.inner_radius);
  const double sure_m = rounded ? 0.0 : kSure * (small_m > 0.0 ? small_m : large_m);
  for (const double factor : kKept) {
    // A point or a line needs no scaling. A shape without volume (a triangle) is not scaled.
    const auto kept = [&](const Placed& s) {
      return s.shape.radius > 0.0 || s.shape.inner_radius == 0.0 ? 1.0 : factor;
    };
    const Closest near = closest(a, kept(a), b, kept(b), guess);
    if (!near.apart || (factor == 1.0 && near.from_b.squaredNorm() < sure_m * sure_m)) continue;
    Closest out = near;
    // Reverses the scaling of the point.
    out.on_a = a.centre() + (near.on_a - a.centre()) / kept(a);
    out.on_b = b.centre() + (near.on_b - b.centre()) / kept(b);
    return {out, near.from_b.normalized(), factor >= kLeastShallow};
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

/// The face with the largest separation: of those at the shapes' nearest vertices, or of all if the shapes penetrate
/// deeply.
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

/// The face of the last step stays the reference face as long as the other shape's deepest point is over it.
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
  // A contact with a single point needs no reference face.
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
