#pragma once

#include "model/body.hpp"

#include <span>
#include <vector>

namespace subworld::ode {

/// True if ODE finds only the deepest point of a contact that may be a line or a face: hulls, capsules and cylinders
/// with each other and with boxes.
[[nodiscard]] bool needs_patch(ShapeKind a, ShapeKind b) noexcept;

/// A shape in ODE's size, skin included. `points` are those of a hull, body frame.
struct Solid {
  const Shape* shape;
  Pose pose;
  std::span<const double> points;
};

struct PatchPoint {
  Vec3 point;
  double depth;  ///< m
};

/// Contact points of two solids whose deepest point has this normal (unit, from b to a). The face of one solid that is
/// perpendicular to the normal is the reference face; the opposite side of the other solid is clipped to it. The normal
/// becomes that of the face. Empty if there is no such face: then the deepest point is the only one.
[[nodiscard]] std::vector<PatchPoint> patch(const Solid& a, const Solid& b, Vec3& normal);

}  // namespace subworld::ode
