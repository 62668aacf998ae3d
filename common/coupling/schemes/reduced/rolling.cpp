#include "coupling/schemes/reduced/rolling.hpp"

#include <cmath>

namespace subworld {

namespace {

constexpr double kRoundAbout = 0.9;  ///< cosine; what is turned by more out of its axis does not roll

}  // namespace

std::optional<double> rolling_mass(const Body& body, const Quat& orientation, const Vec3& axis) {
  const bool lies = body.shape.kind == ShapeKind::capsule || body.shape.kind == ShapeKind::cylinder;
  if (!body.rotates || !(lies || body.shape.kind == ShapeKind::sphere)) return std::nullopt;
  const double along = std::abs((orientation * Vec3::UnitZ()).dot(axis));
  if (lies && along < kRoundAbout * axis.norm()) return std::nullopt;
  return body.inertia.z() / (body.shape.radius * body.shape.radius);
}

}  // namespace subworld
