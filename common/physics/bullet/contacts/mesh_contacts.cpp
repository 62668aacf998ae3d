#include "physics/bullet/contacts/contact_algorithm.hpp"
#include "physics/bullet/contacts/convex_contacts.hpp"
#include "physics/bullet/contacts/convex_points.hpp"
#include "physics/bullet/contacts/corners.hpp"
#include "physics/triangle_edges.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace subworld::bullet {

namespace {

/// Contacts of a convex body with the triangles of a mesh: one manifold for each direction of pushing. An edge or a
/// corner pushes only outwards from all triangles that meet there: a body that slides over a flat mesh does not feel
/// its inner edges.
class ConvexMesh final : public ContactAlgorithm {
 public:
  ConvexMesh(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject& a, const btCollisionObject& b,
             bool swapped)
      : ContactAlgorithm(info, swapped), same_(same_within(a, b)), pair_(a, b) {
    for (auto& manifold : manifolds_) manifold = new_manifold(*m_dispatcher, a, b);
    nearby_.reserve(kUsuallyNear);
    reach_ = manifolds_[0]->getContactBreakingThreshold();
  }
  ~ConvexMesh() override {
    for (auto* manifold : manifolds_) m_dispatcher->releaseManifold(manifold);
  }
  void getAllContactManifolds(btManifoldArray& all) override {
    for (auto* manifold : manifolds_) all.push_back(manifold);
  }
  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* /*result*/) override {
    const auto [a, b] = ordered(first, second);
    const btVector3& origin = a.getWorldTransform().getOrigin();
    const Placed now = placed(a, origin);
    const double way = pair_.way(a, b, info.m_timeStep);
    gather(now, a, b, origin, way, info.m_timeStep);
    const bool ahead = groups_ == 0 && way > 0.0;
    const Placed then = ahead ? first_at(now, a, b, origin, way, info.m_timeStep) : now;
    write_groups(now, then, a, b, origin);
  }

 private:
  static constexpr std::size_t kDirections = 4;
  static constexpr double kSameDirection = 0.999;  ///< cosine
  static constexpr std::size_t kMostFound = 64;
  static constexpr std::size_t kUsuallyNear = 256;  ///< triangles: more cost an allocation once
  static constexpr double kAlong = 1.0 - 1e-7;      ///< cosine: a contact along the triangle's normal is no edge's

  /// Points of all triangles that push in one direction.
  struct Group {
    Vec3 normal;
    std::array<PatchPoint, kMostFound> points;
    std::size_t count = 0;
    double deepest = 0.0;
  };

  /// Calls `visit(triangle, number)` for each triangle that intersects the box, in the frame at `origin`.
  template <class Visit>
  static void for_triangles(const btCollisionObject& mesh, const Vec3& lower, const Vec3& upper,
                            const btVector3& origin, const Visit& visit) {
    struct Callback final : btTriangleCallback {
      void processTriangle(btVector3* corners, int /*part*/, int number) override {
        std::array<Vec3, 3> at;
        for (std::size_t i = 0; i < 3; ++i) at[i] = from_bullet((*pose)(corners[i]) - origin);
        const ConvexTriangle triangle(at[0], at[1], at[2]);
        if (!triangle.normal().isZero()) (*visit)(triangle, number);
      }
      const Visit* visit = nullptr;
      const btTransform* pose = nullptr;
      btVector3 origin;
    } callback;
    callback.visit = &visit;
    callback.pose = &mesh.getWorldTransform();
    callback.origin = origin;
    const btVector3 half = to_bullet(0.5 * (upper - lower)), middle = to_bullet(0.5 * (upper + lower)) + origin;
    const btTransform to_mesh = mesh.getWorldTransform().inverse();
    const btVector3 local = to_mesh * middle;
    const btMatrix3x3 turn = to_mesh.getBasis().absolute();
    const btVector3 room(turn[0].dot(half), turn[1].dot(half), turn[2].dot(half));
    static_cast<const btConcaveShape*>(mesh.getCollisionShape())
        ->processAllTriangles(&callback, local - room, local + room);
  }

  /// The box around a body, enlarged by reach.
  static Box box_around(const Placed& body, double reach) {
    Box box;
    for (int i = 0; i < 3; ++i) {
      box.lower[i] = -body.reach(-Vec3::Unit(i)) - reach;
      box.upper[i] = body.reach(Vec3::Unit(i)) + reach;
    }
    return box;
  }

  /// For a direction in which the body touches now, includes all points within `way`.
  void gather(const Placed& body, const btCollisionObject& object, const btCollisionObject& mesh,
              const btVector3& origin, double way, double dt) {
    groups_ = 0;
    const double reach = std::max(reach_, way);
    const Box box = box_around(body, reach);
    nearby_.clear();
    for_triangles(mesh, box.lower, box.upper, origin, [&](const ConvexTriangle& triangle, int number) {
      const auto& corners = triangle.get().vertices;
      nearby_.push_back({{corners[0], corners[1], corners[2]}, number});
    });
    const Sweep sweep(object), still(mesh);
    const auto passes = [&](const Patch& patch, const Placed& triangle) {
      return passes_by(patch, body, sweep, triangle, still, dt, kFine * reach_);
    };
    for (const auto& [corners, number] : nearby_)
      touch_triangle(body, ConvexTriangle(corners[0], corners[1], corners[2]), number, reach, passes);
    const auto end = std::remove_if(group_.begin(), group_.begin() + groups_,
                                    [&](const Group& group) { return group.deepest > reach_; });
    groups_ = static_cast<std::size_t>(end - group_.begin());
  }

  /// Pose in which the body first touches a triangle within the step, with the contacts of that triangle; else the
  /// present pose.
  Placed first_at(const Placed& now, const btCollisionObject& a, const btCollisionObject& mesh, const btVector3& origin,
                  double way, double dt) {
    const Sweep sweep(a), still(mesh);
    Box box = box_around(now, reach_);
    box.extend(box_around(sweep.after(now, dt), reach_));
    double first = dt;
    bool any = false;
    for_triangles(mesh, box.lower, box.upper, origin, [&](const ConvexTriangle& triangle, int /*number*/) {
      const Placed fixed{triangle.get(), Eigen::Matrix3d::Identity(), Vec3::Zero()};
      const auto when = first_touch(now, sweep, fixed, still, first, kFine * reach_);
      if (!when) return;
      first = *when;
      any = true;
    });
    if (!any) return now;
    const Placed then = sweep.after(now, first);
    gather(then, a, mesh, origin, way, dt);
    return then;
  }

  template <class Passes>
  void touch_triangle(const Placed& body, const ConvexTriangle& triangle, int number, double reach,
                      const Passes& passes) {
    const Placed placed_triangle{triangle.get(), Eigen::Matrix3d::Identity(), Vec3::Zero()};
    PatchMemory memory;
    const Patch patch = touch(body, placed_triangle, reach, kFine * reach_, memory);
    if (patch.count == 0) return;
    double deepest = patch.points[0].distance;
    for (const PatchPoint& p : patch.all()) deepest = std::min(deepest, p.distance);
    // A point beyond the usual distance counts only if it is in a plane that the body touches now.
    const bool flat = std::abs(patch.normal.dot(triangle.normal())) > kSameDirection;
    const double above = -body.reach(-patch.normal) - patch.normal.dot(triangle.get().centre);
    if (deepest > reach_ && !(flat && above <= reach_)) return;
    if (std::abs(patch.normal.dot(triangle.normal())) < kAlong && is_inner(patch)) return;
    if (passes(patch, placed_triangle)) return;
    Group* group = group_for(patch.normal, deepest);
    if (group == nullptr) return;
    group->deepest = std::min(group->deepest, deepest);
    for (const PatchPoint& p : patch.all()) {
      const bool there =
          std::any_of(group->points.begin(), group->points.begin() + group->count,
                      [&](const PatchPoint& q) { return (q.on_b - p.on_b).squaredNorm() < reach_ * reach_; });
      if (there) continue;
      if (group->count == kMostFound) thin(*group);
      group->points[group->count++] = {p.on_b, p.distance, (number << 6) ^ p.feature};
    }
  }

  /// Whether a triangle that meets another one's contact rises beyond it: then the contact is none of the surface.
  [[nodiscard]] bool is_inner(const Patch& patch) const {
    const Vec3& deepest = std::ranges::min(patch.all(), {}, &PatchPoint::distance).on_b;
    return std::ranges::any_of(
        nearby_, [&](const auto& one) { return rises(one.first, deepest, patch.normal, kFine * reach_); });
  }
  /// Of more points than there is room for, the outermost ones and the deepest remain.
  static void thin(Group& group) {
    constexpr int kOutermost = 16;
    const Vec3 u = across(group.normal), v = group.normal.cross(u);
    std::array<bool, kMostFound> kept{};
    const auto keep_most = [&](const auto& of) {
      const auto most = std::ranges::max_element(group.points, {}, of);
      kept[static_cast<std::size_t>(most - group.points.begin())] = true;
    };
    keep_most([](const PatchPoint& p) { return -p.distance; });
    for (int k = 0; k < kOutermost; ++k) {
      const double angle = 2.0 * M_PI * k / kOutermost;
      const Vec3 along = std::cos(angle) * u + std::sin(angle) * v;
      keep_most([&](const PatchPoint& p) { return along.dot(p.on_b); });
    }
    group.count = 0;
    for (std::size_t i = 0; i < kMostFound; ++i) {
      if (kept[i]) group.points[group.count++] = group.points[i];
    }
  }

  /// If there are too many directions, the one with the least penetration is replaced.
  Group* group_for(const Vec3& normal, double deepest) {
    for (std::size_t i = 0; i < groups_; ++i) {
      if (group_[i].normal.dot(normal) > kSameDirection) return &group_[i];
    }
    Group* free = nullptr;
    if (groups_ < kDirections) {
      free = &group_[groups_++];
    } else {
      free = &*std::max_element(group_.begin(), group_.end(),
                                [](const Group& x, const Group& y) { return x.deepest < y.deepest; });
      if (free->deepest <= deepest) return nullptr;
    }
    free->normal = normal;
    free->count = 0;
    free->deepest = deepest;
    return free;
  }

  /// The deepest point, and three more with the largest area.
  Points four_of(const Group& group, const Placed& now, const Placed& then, const btVector3& origin) const {
    static const Convex kNothing{};
    static const Placed fixed_here{kNothing, Eigen::Matrix3d::Identity(), Vec3::Zero()};
    Points chosen;
    chosen.normal = to_bullet(group.normal);
    std::array<std::size_t, kMostPoints> pick{};
    std::size_t picked = 0;
    const auto farthest = [&](auto&& measure) {
      std::size_t best = 0;
      double most = -1e30;
      for (std::size_t i = 0; i < group.count; ++i) {
        if (std::find(pick.begin(), pick.begin() + picked, i) != pick.begin() + picked) continue;
        const double m = measure(group.points[i]);
        if (m <= most * (1.0 + 1e-6)) continue;
        most = m;
        best = i;
      }
      pick[picked++] = best;
    };
    if (group.count <= kMostPoints) {
      for (; picked < group.count; ++picked) pick[picked] = picked;
    } else {
      const auto at = [&](std::size_t i) -> const Vec3& { return group.points[pick[i]].on_b; };
      farthest([&](const PatchPoint& p) {
        return p.distance <= group.deepest + kFine * reach_ ? p.on_b.squaredNorm() : -1.0;
      });
      farthest([&](const PatchPoint& p) { return (p.on_b - at(0)).squaredNorm(); });
      farthest([&](const PatchPoint& p) { return std::abs((at(1) - at(0)).cross(p.on_b - at(0)).dot(group.normal)); });
      const double side = (at(1) - at(0)).cross(at(2) - at(0)).dot(group.normal);
      farthest([&](const PatchPoint& p) {
        return -std::copysign(1.0, side) * (at(1) - at(0)).cross(p.on_b - at(0)).dot(group.normal);
      });
    }
    for (std::size_t i = 0; i < picked; ++i) {
      const PatchPoint& p = group.points[pick[i]];
      const Ahead ahead{p.on_b + p.distance * group.normal, p.on_b, p.distance};
      const bool later = then.at != now.at || then.turn != now.turn;
      chosen.points[chosen.count++] =
          seen_from_now(later ? back_from(p, group.normal, then, now, fixed_here, fixed_here) : ahead, group.normal,
                        p.feature, origin);
    }
    return chosen;
  }

  /// Each direction uses the manifold that it had in the previous step.
  void write_groups(const Placed& now, const Placed& then, const btCollisionObject& a, const btCollisionObject& b,
                    const btVector3& origin) {
    std::array<bool, kDirections> used{};
    std::array<std::size_t, kDirections> place;
    place.fill(kDirections);
    for (std::size_t i = 0; i < groups_; ++i) {
      for (std::size_t m = 0; m < kDirections; ++m) {
        if (used[m] || manifolds_[m]->getNumContacts() == 0) continue;
        const Vec3 normal = from_bullet(manifolds_[m]->getContactPoint(0).m_normalWorldOnB);
        if (normal.dot(group_[i].normal) < kSameDirection) continue;
        used[m] = true;
        place[i] = m;
        break;
      }
    }
    for (std::size_t i = 0; i < groups_; ++i) {
      for (std::size_t m = 0; m < kDirections && place[i] == kDirections; ++m) {
        if (used[m]) continue;
        used[m] = true;
        place[i] = m;
      }
      write(*manifolds_[place[i]], four_of(group_[i], now, then, origin), a, b, same_);
    }
    for (std::size_t m = 0; m < kDirections; ++m) {
      if (!used[m] && manifolds_[m]->getNumContacts() > 0) manifolds_[m]->clearManifold();
    }
  }

  std::array<btPersistentManifold*, kDirections> manifolds_;
  double reach_ = 0.0;  ///< there are no points beyond this distance, m
  btScalar same_;
  FastPair pair_;
  std::size_t groups_ = 0;
  // Shared: the algorithms run one after the other.
  static thread_local std::array<Group, kDirections> group_;
  static thread_local std::vector<std::pair<TriangleCorners, int>> nearby_;  ///< triangles in reach, and their numbers
};
thread_local std::array<ConvexMesh::Group, ConvexMesh::kDirections> ConvexMesh::group_;
thread_local std::vector<std::pair<TriangleCorners, int>> ConvexMesh::nearby_;

}  // namespace

void register_mesh_contacts(btCollisionDispatcher& dispatcher) {
  static Make<ConvexMesh> mesh(false), swapped_mesh(true);
  for (const int one : kConvexShapes) {
    dispatcher.registerCollisionCreateFunc(one, TRIANGLE_MESH_SHAPE_PROXYTYPE, &mesh);
    dispatcher.registerCollisionCreateFunc(TRIANGLE_MESH_SHAPE_PROXYTYPE, one, &swapped_mesh);
  }
}

}  // namespace subworld::bullet
