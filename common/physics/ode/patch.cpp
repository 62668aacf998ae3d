#include "patch.hpp"

#include "shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace subworld::ode {

namespace {

constexpr double kLooksAlong = 0.995;  ///< cosine: 6 degrees
constexpr double kSlope = 0.1;         ///< slope up to which a corner belongs to the side that faces a direction
constexpr int kRim = 8;                ///< corners of a cylinder's end

/// Every corner that a shape could touch with along `d` (unit); both in the shape's frame.
std::vector<Vec3> corners(const Solid& solid, const Vec3& d) {
  const Shape& shape = *solid.shape;
  std::vector<Vec3> all;
  switch (shape.kind) {
    case ShapeKind::box:
      for (int i = 0; i < 8; ++i) {
        const Vec3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        all.push_back(sign.cwiseProduct(Vec3(shape.half_extents.array() + kSkin)));
      }
      break;
    case ShapeKind::convex:
      for (std::size_t i = 0; i + 2 < solid.points.size(); i += 3) {
        all.emplace_back(solid.points[i], solid.points[i + 1], solid.points[i + 2]);
      }
      break;
    case ShapeKind::capsule:
      for (const double end : {-shape.half_length, shape.half_length}) {
        all.push_back(end * Vec3::UnitZ() + (shape.radius + kSkin) * d);
      }
      break;
    case ShapeKind::cylinder: {
      const double radius = shape.radius + kSkin;
      const double half = shape.half_length + kSkin;
      if (std::abs(d.z()) > 0.5) {
        for (int i = 0; i < kRim; ++i) {
          const double angle = 2.0 * std::numbers::pi * i / kRim;
          all.emplace_back(radius * std::cos(angle), radius * std::sin(angle), std::copysign(half, d.z()));
        }
      } else {
        const Vec3 out = radius * Vec3(d.x(), d.y(), 0.0).normalized();
        all = {out - half * Vec3::UnitZ(), out + half * Vec3::UnitZ()};
      }
      break;
    }
    default:
      break;
  }
  return all;
}

/// The side of a solid that faces `direction`: a corner, an edge or a face, in world frame and, seen from outside,
/// counter-clockwise.
std::vector<Vec3> side(const Solid& solid, const Vec3& direction) {
  const Vec3 d = solid.pose.orientation.conjugate() * direction;
  std::vector<Vec3> found = corners(solid, d);
  if (found.empty()) return found;
  const Vec3 top =
      *std::max_element(found.begin(), found.end(), [&](const Vec3& x, const Vec3& y) { return x.dot(d) < y.dot(d); });
  std::erase_if(found, [&](const Vec3& x) { return (top - x).dot(d) > kSlope * (top - x).norm(); });
  Vec3 centre = Vec3::Zero();
  for (const Vec3& x : found) centre += x / static_cast<double>(found.size());
  const Vec3 u = d.unitOrthogonal(), v = d.cross(u);
  std::sort(found.begin(), found.end(), [&](const Vec3& x, const Vec3& y) {
    return std::atan2(v.dot(x - centre), u.dot(x - centre)) < std::atan2(v.dot(y - centre), u.dot(y - centre));
  });
  for (Vec3& x : found) x = solid.pose.position + solid.pose.orientation * x;
  return found;
}

/// Newell's method; zero for an edge or a corner.
Vec3 face_normal(const std::vector<Vec3>& face) {
  Vec3 sum = Vec3::Zero();
  if (face.size() < 3) return sum;
  for (std::size_t i = 0; i < face.size(); ++i) sum += face[i].cross(face[(i + 1) % face.size()]);
  const double length = sum.norm();
  return length > 0.0 ? Vec3(sum / length) : Vec3::Zero();
}

/// Clips to the inner side of a plane (Sutherland and Hodgman 1974).
std::vector<Vec3> clip(const std::vector<Vec3>& held, const Vec3& on_plane, const Vec3& outwards) {
  std::vector<Vec3> kept;
  const std::size_t edges = held.size() > 2 ? held.size() : held.size() - 1;  // an edge is not closed
  const auto outside = [&](const Vec3& x) { return outwards.dot(x - on_plane); };
  for (std::size_t i = 0; i < held.size(); ++i) {
    const double here = outside(held[i]);
    if (here <= 0.0) kept.push_back(held[i]);
    if (i >= edges) continue;
    const Vec3& next = held[(i + 1) % held.size()];
    const double there = outside(next);
    if ((here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0)) {
      kept.push_back(held[i] + here / (here - there) * (next - held[i]));
    }
  }
  return kept;
}

}  // namespace

bool needs_patch(ShapeKind a, ShapeKind b) noexcept {
  const auto solid = [](ShapeKind kind) {
    return kind == ShapeKind::box || kind == ShapeKind::convex || kind == ShapeKind::capsule ||
           kind == ShapeKind::cylinder;
  };
  return solid(a) && solid(b) && !(a == b && (a == ShapeKind::box || a == ShapeKind::capsule));
}

std::vector<PatchPoint> patch(const Solid& a, const Solid& b, Vec3& normal) {
  const std::vector<Vec3> on_a = side(a, -normal), on_b = side(b, normal);
  const Vec3 face_a = face_normal(on_a), face_b = face_normal(on_b);
  const double along_a = -face_a.dot(normal), along_b = face_b.dot(normal);
  if (std::max(along_a, along_b) < kLooksAlong) return {};
  const bool a_is_flat = along_a > along_b;
  const std::vector<Vec3>& face = a_is_flat ? on_a : on_b;
  const Vec3 outwards = a_is_flat ? face_a : face_b;
  std::vector<Vec3> held = a_is_flat ? on_b : on_a;
  for (std::size_t i = 0; i < face.size() && !held.empty(); ++i) {
    held = clip(held, face[i], (face[(i + 1) % face.size()] - face[i]).cross(outwards));
  }
  std::vector<PatchPoint> points;
  for (const Vec3& x : held) {
    const double depth = outwards.dot(face.front() - x);
    if (depth >= 0.0) points.push_back({x, depth});
  }
  if (!points.empty()) normal = a_is_flat ? Vec3(-outwards) : outwards;
  return points;
}

}  // namespace subworld::ode
