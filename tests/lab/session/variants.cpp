#include "lab/session/variants.hpp"

#include "lab/session/draw.hpp"

#include <algorithm>
#include <numbers>

namespace subworld {

namespace {

constexpr double kMostTurn_rad = 6.0 * std::numbers::pi / 180.0;
constexpr double kMostAside = 0.08;    ///< of the longest move
constexpr double kLeastAside_s = 0.1;  ///< duration of the sideways move if a path begins at once

PathSegment turned(PathSegment s, const Quat& by, double stretch) {
  s.displacement = stretch * (by * s.displacement);
  s.axis = by * s.axis;
  s.angle *= stretch;
  s.radius *= stretch;
  s.along = by * s.along;
  s.across = by * s.across;
  s.amplitude *= stretch;
  return s;
}

/// A move across the longest one, before all others.
PathSegment aside(const std::vector<PathSegment>& path, const Vec3& direction, double part) {
  Vec3 longest = Vec3::Zero();
  double begins_s = path.front().from_s;
  for (const PathSegment& s : path) {
    if (s.displacement.norm() > longest.norm()) longest = s.displacement;
    begins_s = std::min(begins_s, s.from_s);
  }
  return {.kind = PathSegment::Kind::move,
          .to_s = begins_s > 0.0 ? begins_s : kLeastAside_s,
          .displacement = part * longest.cross(direction)};
}

}  // namespace

Variation variation(int variant) {
  Variation v;
  if (variant == 0) return v;
  Draw draw(static_cast<std::uint64_t>(variant));
  v.friction = draw.factor(0.8, 1.25);
  v.mass = draw.factor(0.7, 1.4);
  const Vec3 axis = draw.direction();
  v.turn = Eigen::AngleAxisd(draw.between(-kMostTurn_rad, kMostTurn_rad), axis);
  v.stretch = draw.factor(0.85, 1.2);
  v.across = draw.direction();
  v.aside = draw.between(0.0, kMostAside);
  return v;
}

Scene varied(Scene scene, int variant) {
  if (variant == 0) return scene;
  const Variation v = variation(variant);
  for (Body& body : scene.bodies) {
    body.material.friction *= v.friction;
    if (body.fixed() || std::ranges::find(scene.users, body.id, &UserSpec::proxy) != scene.users.end()) continue;
    body.mass *= v.mass;
    body.inertia *= v.mass;
  }
  for (UserSpec& user : scene.users) {
    std::vector<PathSegment>& path = user.device.path;
    if (path.empty()) continue;
    for (PathSegment& s : path) s = turned(s, v.turn, v.stretch);
    path.push_back(aside(path, v.across, v.aside));
  }
  return scene;
}

}  // namespace subworld
