#include "model/scene/scene.hpp"
#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// Two unit vectors that make a right-handed frame with `axis`; for the z axis they are x and y.
std::pair<Vec3, Vec3> plane_of(const Vec3& axis) {
  const Vec3 seed = std::abs(axis.x()) < 0.9 ? Vec3::UnitX() : Vec3::UnitY();
  const Vec3 first = (seed - seed.dot(axis) * axis).normalized();
  return {first, axis.cross(first)};
}

/// Part of the way that is made after the part `s` of the time, and its derivative.
struct Progress {
  double part, rate;
};

Progress progress_of(Profile profile, double s) noexcept {
  if (profile == Profile::constant) return {s, 1.0};
  return {s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * (1.0 - s) * (1.0 - s)};
}

}  // namespace

PathPoint evaluate(const std::vector<PathSegment>& path, double t_s, Profile profile) noexcept {
  PathPoint at;
  for (const PathSegment& s : path) {
    if (s.kind == PathSegment::Kind::wave) continue;
    if (t_s < s.from_s) continue;
    const double length_s = s.to_s - s.from_s;
    const double made =
        s.every_s > 0.0 ? std::floor((t_s - s.from_s) / s.every_s) : 0.0;  // completed repetitions before this one
    const double passed_s = t_s - s.from_s - made * s.every_s;
    const bool moving = passed_s < length_s;
    const Progress now =
        progress_of(s.profile.value_or(profile), length_s > 0.0 ? std::clamp(passed_s / length_s, 0.0, 1.0) : 1.0);
    const double part = made + now.part;
    switch (s.kind) {
      case PathSegment::Kind::move:
        at.offset.position += part * s.displacement;
        if (moving) at.linear_velocity += now.rate * s.displacement / length_s;
        break;
      case PathSegment::Kind::turn: {
        // Earlier repetitions rotate this one, and its angular velocity.
        const Quat turned = rotation_deg(s.axis, part * s.angle * (180.0 / M_PI));
        at.offset.orientation = turned * at.offset.orientation;
        at.angular_velocity = turned * at.angular_velocity;
        if (moving) at.angular_velocity += s.axis * (now.rate * s.angle / length_s);
        break;
      }
      case PathSegment::Kind::circle: {
        const auto [first, second] = plane_of(s.axis);
        const double rate = 2.0 * M_PI / s.period_s;
        const auto [sine, cosine] = sin_cos_deg(360.0 * (std::min(t_s, s.to_s) - s.from_s) / s.period_s);
        at.offset.position += s.radius * ((cosine - 1.0) * first + sine * second);
        if (moving) at.linear_velocity += s.radius * rate * (cosine * second - sine * first);
        break;
      }
      case PathSegment::Kind::wave:
        break;
    }
  }
  // A wave is added to the displacement of all other segments.
  const Vec3 base = at.offset.position;
  const Vec3 speed = at.linear_velocity;
  for (const PathSegment& s : path) {
    if (s.kind != PathSegment::Kind::wave || t_s < s.from_s) continue;
    const auto [sine, cosine] = sin_cos_deg(s.wavenumber * base.dot(s.along) * (180.0 / M_PI));
    at.offset.position += s.amplitude * sine * s.across;
    at.linear_velocity += s.amplitude * s.wavenumber * cosine * speed.dot(s.along) * s.across;
  }
  return at;
}

}  // namespace subworld
