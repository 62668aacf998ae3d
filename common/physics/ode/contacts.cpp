#include "contacts.hpp"

#include "patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace subworld::ode {

namespace {

constexpr std::size_t kMostPoints = 16;  ///< of a pair, in the solver
constexpr double kSameDepth = 1e-8;      ///< m; of points that differ by rounding, always the same ones are kept
constexpr double kSameDistance = 1e-6;
constexpr double kSliding = 1e-4;      ///< m/s; slower contacts count as sticking
constexpr double kSamePlace = 0.01;    ///< m, largest motion of one contact point between two steps
constexpr double kQuietImpact = 1e-3;  ///< m/s; an impact below this plus twice the step's gravity does not bounce

using Pairs = std::vector<std::pair<Number, Number>>;

Solid solid(const Slot& slot, const Piece& piece, const ShapeStore& shapes) {
  return {&piece.part.shape, pose_of(slot, piece), shapes.hull_points(piece.part.shape)};
}

/// Leaves the deepest point and those that differ most in place and normal; the number of points that are left.
std::size_t spread(std::span<dContactGeom> points) {
  if (points.size() <= kMostPoints) return points.size();
  std::size_t deepest = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    if (points[i].depth > points[deepest].depth + kSameDepth) deepest = i;
  }
  std::swap(points[0], points[deepest]);
  double size_m = 0.0;
  for (const dContactGeom& p : points) size_m = std::max(size_m, (from_ode(p.pos) - from_ode(points[0].pos)).norm());
  std::vector<double> nearest(points.size(), std::numeric_limits<double>::max());  // distance to the points before
  for (std::size_t n = 1; n < kMostPoints; ++n) {
    std::size_t farthest = n;
    for (std::size_t i = n; i < points.size(); ++i) {
      const Vec3 way = from_ode(points[i].pos) - from_ode(points[n - 1].pos);
      const Vec3 turn = size_m * (from_ode(points[i].normal) - from_ode(points[n - 1].normal));
      nearest[i] = std::min(nearest[i], way.squaredNorm() + turn.squaredNorm());
      if (nearest[i] > nearest[farthest] * (1.0 + kSameDistance)) farthest = i;
    }
    std::swap(points[n], points[farthest]);
    std::swap(nearest[n], nearest[farthest]);
  }
  return kMostPoints;
}

/// ODE's points of two pieces; their number.
int collide(const Piece& a, const Piece& b, std::span<dContactGeom> found) {
  const int most = most_points(a.part.shape.kind, b.part.shape.kind);
  int count = dCollide(a.geom, b.geom, most, found.data(), sizeof(dContactGeom));
  if (a.back == nullptr && b.back == nullptr) return count;
  // For a box, ODE's triangles have two sides.
  if (a.part.shape.kind != ShapeKind::box && b.part.shape.kind != ShapeKind::box) {
    count += dCollide(a.back ? a.back : a.geom, b.back ? b.back : b.geom, most, &found[static_cast<std::size_t>(count)],
                      sizeof(dContactGeom));
  }
  // A hull's contact with a triangle that it meets from behind has no depth.
  const auto end =
      std::remove_if(found.begin(), found.begin() + count, [](const dContactGeom& c) { return c.depth <= 0.0; });
  return static_cast<int>(end - found.begin());
}

Vec3 across(const Vec3& v, const Vec3& normal) { return v - v.dot(normal) * normal; }

}  // namespace

ContactPoints::ContactPoints(dWorldID world, dSpaceID space, const std::vector<Slot>& slots, const ShapeStore& shapes,
                             double gravity, std::span<const MaterialPair> pairs)
    : world_(world),
      space_(space),
      slots_(slots),
      shapes_(shapes),
      gravity_(gravity),
      material_pairs_(pairs.begin(), pairs.end()),
      joints_(dJointGroupCreate(0)),
      found_(2 * kMostOfMesh) {}

void ContactPoints::find() {
  pairs_.clear();
  dSpaceCollide(space_, &pairs_, [](void* self, dGeomID first, dGeomID second) {
    static_cast<Pairs*>(self)->push_back(std::minmax({Number::of(first), Number::of(second)}));
  });
  std::sort(pairs_.begin(), pairs_.end());
  points_.clear();
  for (const auto& [number_a, number_b] : pairs_) {
    const auto [a, b] = std::pair(number_a.body, number_b.body);
    if (slots_[a].group != 0 && slots_[a].group == slots_[b].group) continue;
    const Piece &piece_a = slots_[a].pieces[number_a.piece], &piece_b = slots_[b].pieces[number_b.piece];
    const ShapeKind kind_a = piece_a.part.shape.kind, kind_b = piece_b.part.shape.kind;
    const double skins = skin(kind_a) + skin(kind_b);
    const auto add = [&](const Vec3& point, const Vec3& normal, double depth) {
      points_.push_back({a, b, &piece_a.part.material, &piece_b.part.material, point, normal, skins - depth});
    };
    auto found = std::span(found_).first(static_cast<std::size_t>(collide(piece_a, piece_b, found_)));
    if (found.empty()) continue;
    if (needs_patch(kind_a, kind_b)) {
      Vec3 normal = from_ode(found[0].normal);
      const auto touching = patch(solid(slots_[a], piece_a, shapes_), solid(slots_[b], piece_b, shapes_), normal);
      for (const auto& [point, depth] : touching) add(point, normal, depth);
      if (!touching.empty()) continue;
    }
    if (kind_a == ShapeKind::mesh || kind_b == ShapeKind::mesh) {
      const bool first = kind_b == ShapeKind::mesh;
      const Piece& piece = first ? piece_a : piece_b;
      if (piece.part.shape.kind != ShapeKind::sphere)
        found = mesh_points_.refine(solid(slots_[first ? a : b], piece, shapes_), piece.geom, first, found);
      found = found.first(spread(found));
    }
    for (const dContactGeom& point : found) add(from_ode(point.pos), from_ode(point.normal), point.depth);
  }
}

void ContactPoints::make_joints(double h) {
  feedback_.resize(points_.size());
  const double quiet = kQuietImpact + 2.0 * gravity_ * h;
  const double slow = kSliding + 0.5 * gravity_ * h;  // speed below which a contact may stop within the step
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& point = points_[i];
    const Material &ma = *point.on_a, &mb = *point.on_b;
    const Vec3 velocity = relative_velocity(point);
    const double approach = -velocity.dot(point.normal);
    dContact contact{};
    std::copy_n(point.point.data(), 3, contact.geom.pos);
    std::copy_n(point.normal.data(), 3, contact.geom.normal);
    // One side of the friction pyramid is along fdir1, the direction of sliding, where friction is mu N.
    contact.surface.mode = dContactApprox1 | dContactMotionN | dContactFDir1 | dContactMu2;
    const Material both = in_contact(ma, mb, material_pairs_);
    contact.surface.mu = both.friction;
    const Vec3 on_a = across(surface_velocity_at(slots_[point.a], point.point), point.normal);
    const Vec3 on_b = across(surface_velocity_at(slots_[point.b], point.point), point.normal);
    const Vec3 along = friction_direction(point, velocity + on_a - on_b, h);
    std::copy_n(along.data(), 3, contact.fdir1);
    if (!on_a.isZero(0.0) || !on_b.isZero(0.0)) {
      // The speed of the movable body, along both directions as ODE makes them of it.
      const double sign = slots_[point.a].body ? 1.0 : -1.0;
      contact.surface.mode |= dContactMotion1 | dContactMotion2;
      contact.surface.motion1 = (on_a + on_b).dot(along);
      contact.surface.motion2 = (on_a + on_b).dot(sign * point.normal.cross(along));
    }
    // Coulomb friction has no component across the sliding; the pyramid's would prevent the body from turning sideways.
    const double sliding = across(velocity + on_a - on_b, point.normal).norm();
    contact.surface.mu2 = contact.surface.mu * std::min(1.0, slow / sliding);
    // The least separation speed after the step: that of the rebound, or the one that closes a gap within the skin.
    if (both.restitution > 0.0 && approach > quiet) {
      contact.surface.motionN = both.restitution * approach;
    } else {
      contact.surface.motionN = -std::max(0.0, point.distance) / h;
    }
    const dJointID joint = dJointCreateContact(world_, joints_, &contact);
    dJointAttach(joint, slots_[point.a].body, slots_[point.b].body);
    feedback_[i] = {};
    dJointSetFeedback(joint, &feedback_[i]);
  }
}

Vec3 ContactPoints::relative_velocity(const ContactPoint& at) const {
  return velocity_at(slots_[at.a], at.point) - velocity_at(slots_[at.b], at.point);
}

/// Unit, across the normal: along the sliding velocity; without sliding, along the load.
Vec3 ContactPoints::friction_direction(const ContactPoint& at, const Vec3& velocity, double h) const {
  const Vec3 sliding = across(velocity, at.normal);
  if (sliding.norm() > kSliding) return sliding.normalized();
  const Vec3 load = across(frictions_.recall(at.a, at.b, at.point), at.normal);
  if (load.norm() > 0.0) return load.normalized();
  const auto pull = [](const Slot& slot) {
    return slot.body ? Vec3((slot.weight + slot.force) / slot.mass) : Vec3::Zero();
  };
  const Vec3 coming = across(h * (pull(slots_[at.a]) - pull(slots_[at.b])), at.normal);
  if (coming.norm() > 1e-12) return coming.normalized();
  return at.normal.unitOrthogonal();
}

void ContactPoints::collect(double h, int substep, ContactTotals& totals) {
  remember_friction(h);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& point = points_[i];
    const Vec3 impulse = impulse_of(i, h);
    Contact contact;
    contact.a = BodyId{point.a};
    contact.b = BodyId{point.b};
    contact.point = point.point;
    contact.normal = point.normal;
    contact.distance = point.distance;
    contact.normal_impulse = std::max(0.0, impulse.dot(point.normal));
    contact.tangential_impulse = impulse - impulse.dot(point.normal) * point.normal;
    if (contact.normal_impulse <= 0.0 && contact.distance > 0.0) continue;
    totals.add(contact, substep, kSamePlace);
  }
}

/// Impulse on body a, N s.
Vec3 ContactPoints::impulse_of(std::size_t i, double h) const {
  // ODE reports the force on the joint's first movable body.
  const double sign = slots_[points_[i].a].body ? 1.0 : -1.0;
  return sign * h * from_ode(feedback_[i].f1);
}

void ContactPoints::remember_friction(double h) {
  frictions_.clear();
  for (std::size_t i = 0; i < points_.size();) {
    const auto [a, b] = std::pair(points_[i].a, points_[i].b);
    pair_.clear();
    for (; i < points_.size() && points_[i].a == a && points_[i].b == b; ++i) {
      pair_.push_back({points_[i].point, points_[i].normal, impulse_of(i, h)});
    }
    frictions_.remember(a, b, pair_);
  }
}

}  // namespace subworld::ode
