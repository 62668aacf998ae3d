#pragma once

#include "model/body.hpp"

#include <span>
#include <vector>

namespace subworld::ode {

/// True where ODE finds only the deepest point of a contact that may be a line or a face: hulls, capsules and cylinders
/// with each other and with boxes.
[[nodiscard]] bool needs_patch(ShapeKind a, ShapeKind b) noexcept;

/// A shape as ODE has it, skin included. `points` are those of a hull, body frame.
struct Solid {
  const Shape* shape;
  Pose pose;
  std::span<const double> points;
};

struct PatchPoint {
  Vec3 point;
  double depth;  ///< m
};

/// Where two solids meet whose deepest point has this normal (unit, from b to a): the face of one of them that looks
/// along it, and what the other one holds against that face, clipped to it. The normal becomes that of the face. Empty
/// if no face looks along the normal: then the deepest point is all there is.
[[nodiscard]] std::vector<PatchPoint> patch(const Solid& a, const Solid& b, Vec3& normal);

}  // namespace subworld::ode
