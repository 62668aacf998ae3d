#include "physics/bullet/contacts/box_box.hpp"

#include "physics/bullet/contacts/contact_algorithm.hpp"
#include "physics/bullet/contacts/convex_contacts.hpp"
#include "physics/bullet/sweep.hpp"

#include <array>
#include <cstddef>
#include <optional>
#include <span>

namespace subworld::bullet {

namespace {

constexpr std::size_t kMostRectangleCorners = 8;  ///< of two rectangles' common part

/// What is chosen stays chosen until another choice is better by this, so that noise does not choose.
constexpr auto kBetterGap = btScalar(0.1);       ///< of the breaking threshold: an axis, a deeper point
constexpr auto kBetterBoxArea = btScalar(1.05);  ///< ratio: four points
/// A point that another corner replaces goes on with its impulses within this part of the smaller box.
constexpr auto kReach = btScalar(0.1);
/// Edges that are closer to parallel (squared sine of their angle) meet as faces do.
constexpr auto kParallelBoxEdges = btScalar(1e-4);

struct Cuboid {
  const btTransform& pose;
  const btVector3& half;

  [[nodiscard]] btVector3 axis(int i) const { return pose.getBasis().getColumn(i); }
};

/// One of the 15 directions that can separate two boxes. Numbers 0 to 2: faces of the first box, 3 to 5: faces of the
/// second, 6 + 3 i + j: the cross product of axis i of the first and axis j of the second.
struct Direction {
  int number = -1;
  btScalar gap = -BT_LARGE_FLOAT;  ///< between the boxes' projections on it, m

  [[nodiscard]] bool is_edge() const { return number >= 6; }
};

/// Relative pose of two boxes, in the frame of the first.
class Relation {
 public:
  Relation(const Cuboid& a, const Cuboid& b)
      : half_a_(a.half),
        half_b_(b.half),
        r_(a.pose.getBasis().transposeTimes(b.pose.getBasis())),
        abs_r_(r_.absolute()),
        t_((b.pose.getOrigin() - a.pose.getOrigin()) * a.pose.getBasis()) {}

  /// Gaps between the boxes' projections, m, along face i of the first or of the second box.
  [[nodiscard]] btScalar on_a(int i) const { return btFabs(t_[i]) - half_a_[i] - half_b_.dot(abs_r_[i]); }
  [[nodiscard]] btScalar on_b(int i) const {
    return btFabs(t_.dot(r_.getColumn(i))) - half_b_[i] - half_a_.dot(abs_r_.getColumn(i));
  }
  /// Along the cross product of edge i of the first and j of the second box. Empty if the edges are parallel, or if the
  /// penetration is deeper than `least` (m).
  [[nodiscard]] std::optional<btScalar> on_edges(int i, int j, btScalar least = -BT_LARGE_FLOAT) const {
    const btScalar square = 1 - r_[i][j] * r_[i][j];
    if (square < kParallelBoxEdges) return {};
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    const btScalar across = btFabs(t_[i2] * r_[i1][j] - t_[i1] * r_[i2][j]) - half_a_[i1] * abs_r_[i2][j] -
                            half_a_[i2] * abs_r_[i1][j] - half_b_[j1] * abs_r_[i][j2] - half_b_[j2] * abs_r_[i][j1];
    if (across < 0 && across <= least) return {};  // the sine is at most 1, so the division does not reduce the depth
    return across / btSqrt(square);
  }

  /// Whether the boxes are at least `reach` apart in the direction of that number.
  [[nodiscard]] bool is_apart(int number, btScalar reach) const {
    if (number < 3) return on_a(number) >= reach;
    if (number < 6) return on_b(number - 3) >= reach;
    const auto gap = on_edges((number - 6) / 3, (number - 6) % 3);
    return gap && *gap >= reach;
  }

 private:
  btVector3 half_a_, half_b_;
  btMatrix3x3 r_, abs_r_;
  btVector3 t_;
};

/// The direction of least penetration; if the boxes are at least `reach` apart, a direction that separates them by as
/// much. `last`: the number of the previous step.
Direction least_deep(const Relation& boxes, int last, btScalar reach) {
  Direction face, edge, last_face, last_edge;
  const auto keep = [&](Direction found, Direction& best, Direction& last_one) {
    if (found.gap > best.gap) best = found;
    if (found.number == last) last_one = found;
    return found.gap < reach;
  };
  for (int i = 0; i < 3; ++i) {
    if (!keep({i, boxes.on_a(i)}, face, last_face)) return face;
    if (!keep({3 + i, boxes.on_b(i)}, face, last_face)) return face;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int number = 6 + 3 * i + j;
      // An edge is chosen only if its penetration is less than that of any face and of any other edge but the last one.
      const btScalar least = number == last ? -BT_LARGE_FLOAT : btMax(face.gap, edge.gap);
      const auto gap = boxes.on_edges(i, j, least);
      if (gap && !keep({number, *gap}, edge, last_edge)) return edge;
    }
  }
  const btScalar better = kBetterGap * reach;
  if (last_face.gap > face.gap - better) face = last_face;
  if (last_edge.gap > edge.gap - better) edge = last_edge;
  return edge.gap > face.gap + (last >= 6 ? 1 : 2) * better ? edge : face;
}

/// A corner of the intersection of two faces, in the frame of the cutting one.
struct RectangleCorner {
  btScalar x, y, height;  ///< m; height above that face
  int feature;
  int edge;  ///< edge that starts here: 0 to 3 of the cut face, 4 to 7 of the cutting one
};

class Polygon {
 public:
  void add(const RectangleCorner& corner) { corners_[count_++] = corner; }

  /// Clips at `half` on one of four sides: +x, -x, +y, -y.
  void cut(int side, btScalar half) {
    const auto outside = [&](const RectangleCorner& c) {
      const btScalar along = side < 2 ? c.x : c.y;
      return (side % 2 == 0 ? along : -along) - half;
    };
    std::array<btScalar, kMostRectangleCorners> out;
    bool any_out = false;
    for (std::size_t i = 0; i < count_; ++i) {
      out[i] = outside(corners_[i]);
      any_out = any_out || !(out[i] <= 0);
    }
    if (!any_out) return;
    const std::array<RectangleCorner, kMostRectangleCorners> whole = corners_;
    const std::size_t whole_count = count_;
    count_ = 0;
    for (std::size_t i = 0; i < whole_count; ++i) {
      const std::size_t next = i + 1 < whole_count ? i + 1 : 0;
      const RectangleCorner &from = whole[i], &to = whole[next];
      const btScalar out_from = out[i], out_to = out[next];
      if (out_from <= 0 && count_ < kMostRectangleCorners) add(from);
      if ((out_from <= 0) == (out_to <= 0) || count_ == kMostRectangleCorners) continue;
      const btScalar part = out_from / (out_from - out_to);
      add({from.x + part * (to.x - from.x), from.y + part * (to.y - from.y),
           from.height + part * (to.height - from.height), 4 + 8 * side + from.edge,
           out_from <= 0 ? 4 + side : from.edge});
    }
  }

  void remove_above(btScalar height) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      if (corners_[i].height < height) corners_[kept++] = corners_[i];
    }
    count_ = kept;
  }

  /// Reduces to four points: those in `before` (features), unless others span a larger area or are deeper by `deeper`.
  template <class IsBefore>
  void reduce(const IsBefore& before, btScalar deeper) {
    if (count_ <= kMostPoints) return;
    std::size_t deepest = 0;
    for (std::size_t i = 1; i < count_; ++i) {
      if (corners_[i].height < corners_[deepest].height) deepest = i;
    }
    std::array<bool, kMostRectangleCorners> was, deep;
    for (std::size_t i = 0; i < count_; ++i) {
      was[i] = before(corners_[i].feature);
      deep[i] = corners_[i].height < corners_[deepest].height + deeper;
    }
    const auto area = [&](const Four& f) {
      const RectangleCorner &p = corners_[f[0]], &q = corners_[f[1]], &r = corners_[f[2]], &s = corners_[f[3]];
      return btFabs((r.x - p.x) * (s.y - q.y) - (r.y - p.y) * (s.x - q.x));
    };
    const Four best = widest_four(count_, was, deep, kBetterBoxArea, area);
    for (std::size_t i = 0; i < kMostPoints; ++i) corners_[i] = corners_[best[i]];
    count_ = kMostPoints;
  }

  [[nodiscard]] std::span<const RectangleCorner> corners() const { return {corners_.data(), count_}; }

 private:
  std::array<RectangleCorner, kMostRectangleCorners> corners_;
  std::size_t count_ = 0;
};

/// The intersection of a face of one box and the opposite face of the other.
template <class IsBefore>
Points meet_on_face(const Cuboid& a, const Cuboid& b, int number, btScalar reach, btScalar deeper,
                    const IsBefore& before) {
  const bool of_a = number < 3;
  const Cuboid& cutting = of_a ? a : b;
  const Cuboid& cut = of_a ? b : a;
  const int k = number % 3;
  btVector3 normal = cutting.axis(k);
  const bool back = normal.dot(cut.pose.getOrigin() - cutting.pose.getOrigin()) < 0;
  if (back) normal = -normal;
  const btVector3 face = cutting.pose.getOrigin() + cutting.half[k] * normal;
  const btVector3 u = cutting.axis((k + 1) % 3), v = cutting.axis((k + 2) % 3);

  const btVector3 facing = normal * cut.pose.getBasis();
  const int m = facing.absolute().maxAxis();
  const btScalar sign = facing[m] > 0 ? btScalar(-1) : btScalar(1);
  const btVector3 centre = cut.pose.getOrigin() + sign * cut.half[m] * cut.axis(m) - face;
  const btVector3 side_1 = cut.half[(m + 1) % 3] * cut.axis((m + 1) % 3);
  const btVector3 side_2 = cut.half[(m + 2) % 3] * cut.axis((m + 2) % 3);
  const int faces = ((number * 2 + (back ? 1 : 0)) * 3 + m) * 2 + (sign > 0 ? 1 : 0);

  Polygon common;
  const btVector3 ring[] = {side_1 + side_2, side_2 - side_1, -side_1 - side_2, side_1 - side_2};
  for (int i = 0; i < 4; ++i) {
    const btVector3 corner = centre + ring[i];
    common.add({corner.dot(u), corner.dot(v), corner.dot(normal), i, i});
  }
  for (int side = 0; side < 4; ++side) common.cut(side, cutting.half[(k + 1 + side / 2) % 3]);
  common.remove_above(reach);
  const auto feature = [&](int corner) { return 64 * faces + corner; };
  common.reduce([&](int corner) { return before(feature(corner)); }, deeper);

  Points all;
  all.normal = of_a ? -normal : normal;
  for (const RectangleCorner& c : common.corners()) {
    const btVector3 on_face = face + c.x * u + c.y * v;
    all.points[all.count++] = {of_a ? on_face + c.height * normal : on_face, c.height, feature(c.feature)};
  }
  return all;
}

/// The midpoint of two edges where they are nearest to each other.
Points meet_on_edges(const Cuboid& a, const Cuboid& b, int number) {
  const int i = (number - 6) / 3, j = (number - 6) % 3;
  const btVector3 along_a = a.axis(i), along_b = b.axis(j);
  btVector3 normal = along_a.cross(along_b).normalized();  // from a to b
  const btVector3 between = b.pose.getOrigin() - a.pose.getOrigin();
  if (normal.dot(between) < 0) normal = -normal;
  const auto nearest_edge = [](const Cuboid& box, int axis, const btVector3& to) {
    btVector3 middle = box.pose.getOrigin();
    for (int k = 0; k < 3; ++k) {
      if (k != axis) middle += (to.dot(box.axis(k)) > 0 ? box.half[k] : -box.half[k]) * box.axis(k);
    }
    return middle;
  };
  const btVector3 on_a = nearest_edge(a, i, normal);
  const btVector3 on_b = nearest_edge(b, j, -normal);
  // The point of b's edge over a's edge: (on_b + s along_b - on_a) has only a component along the normal and across a's
  // edge.
  const btScalar cosine = along_a.dot(along_b);
  const btVector3 apart = on_a - on_b;
  const btScalar s = (apart.dot(along_b) - cosine * apart.dot(along_a)) / (1 - cosine * cosine);
  const btVector3 point = on_b + btClamped(s, -b.half[j], b.half[j]) * along_b;
  Points all;
  all.normal = -normal;
  all.points[all.count++] = {point, (on_b - on_a).dot(normal), 64 * 1000 + number};
  return all;
}

class BoxBox final : public OneManifold {
 public:
  BoxBox(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject& first,
         const btCollisionObject& second, bool swapped)
      : OneManifold(info, first, second, swapped),
        half_a_(half_of(first)),
        half_b_(half_of(second)),
        reach_(manifold_->getContactBreakingThreshold()),
        same_(kReach * btMin(half_a_.length(), half_b_.length())),
        pair_(first, second) {}

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* result) override {
    result->setPersistentManifold(manifold_);
    const Cuboid a{first->getWorldTransform(), half_a_}, b{second->getWorldTransform(), half_b_};
    const btCollisionObject &one = *first->getCollisionObject(), &other = *second->getCollisionObject();
    const Relation boxes(a, b);
    const double dt = info.m_timeStep, way = pair_.way(one, other, dt);
    const btScalar near = looks_ahead() && way == 0.0 ? btMax(reach_, scalar(pair_.motion(one, other, dt))) : reach_;
    if (separating_ >= 0 && boxes.is_apart(separating_, near)) {  // as in the previous step
      return leave(one, other, way, dt);
    }
    const Direction direction = least_deep(boxes, last_, near);
    if (direction.gap >= near) {
      separating_ = direction.number;
      last_ = -1;
      return leave(one, other, way, dt);
    }
    separating_ = -1;
    last_ = direction.number;

    std::array<LastPoint, kMostPoints> before;
    ManifoldWriter writer(*manifold_, reach_, same_);
    const std::span<const LastPoint> old = writer.take(before);
    const auto is_old = [&](int feature) {
      for (const LastPoint& point : old) {
        if (point.feature == feature) return true;
      }
      return false;
    };
    const btScalar reach = btMax(near, scalar(way));
    writer.put(direction.is_edge() ? meet_on_edges(a, b, direction.number)
                                   : meet_on_face(a, b, direction.number, reach, kBetterGap * reach_, is_old),
               one, other, reach);
    writer.go_on_from(old);
  }

 private:
  static btVector3 half_of(const btCollisionObject& object) {
    return static_cast<const btBoxShape*>(object.getCollisionShape())->getHalfExtentsWithMargin();
  }

  /// The boxes are apart.
  void leave(const btCollisionObject& a, const btCollisionObject& b, double way, double dt) {
    if (way > 0.0) {
      look_ahead(*manifold_, a, b, way, dt);
    } else if (manifold_->getNumContacts() > 0) {
      manifold_->clearManifold();
    }
  }

  btVector3 half_a_, half_b_;
  btScalar reach_;  ///< there are no points beyond this distance, m
  btScalar same_;   ///< a point inherits impulses within this distance, m
  FastPair pair_;
  int last_ = -1;        ///< number of the direction of the previous step
  int separating_ = -1;  ///< number of the direction that separated the boxes in the previous step
};

}  // namespace

void register_box_box(btCollisionDispatcher& dispatcher) {
  static Make<BoxBox> make;
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, &make);
}

}  // namespace subworld::bullet
