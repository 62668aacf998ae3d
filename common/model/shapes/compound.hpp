#pragma once

#include "model/body.hpp"

#include <span>

namespace subworld {

struct WeightedPart {
  BodyPart part;
  double mass = 0.0;            ///< kg
  Vec3 inertia = Vec3::Zero();  ///< principal moments about the part's origin, kg m^2
};

/// A compound body in its principal frame at the centre of mass. Where parts overlap, their masses add.
struct Compound {
  Mesh mesh;                    ///< parts, and triangles around them
  Pose frame;                   ///< the principal frame in that of the parts
  double mass = 0.0;            ///< kg
  Vec3 inertia = Vec3::Zero();  ///< principal moments, kg m^2
};
/// Mass, centre of mass and tensor about it, in the frame of the parts: kg, m, kg m^2.
struct MassProperties {
  double mass = 0.0;
  Vec3 centre = Vec3::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
};
[[nodiscard]] MassProperties total_of(std::span<const WeightedPart> parts);
[[nodiscard]] Compound assemble(std::span<const WeightedPart> parts, std::span<const Mesh> meshes,
                                const MassProperties& whole);
[[nodiscard]] inline Compound assemble(std::span<const WeightedPart> parts, std::span<const Mesh> meshes) {
  return assemble(parts, meshes, total_of(parts));
}

/// Triangles around a sphere, box, capsule, cylinder or convex shape, outwards. Round ones are inscribed.
[[nodiscard]] Mesh surface(const Shape& shape, std::span<const Mesh> meshes);

}  // namespace subworld
