#pragma once

#include "model/messages/message_fields.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

/// What the scheme `reduced` adds to a frame: models of the bodies outside a sub-world.
namespace subworld {

/// A Coulomb limit that no load in a scene exceeds. It marks a body that does not move.
inline constexpr double kWallLimit_n = 1e9;

/// Resistance of an outside body to a push along one direction.
struct GhostAxis {
  /// Towards the inside bodies, or an unconstrained direction; the axes of a ghost are orthogonal.
  Vec3 normal = Vec3::UnitZ();
  double force_n = 0.0;          ///< present force along `normal`
  double coulomb_limit_n = 0.0;  ///< under the model's load; kWallLimit_n: a wall
  Vec3 load_dependent_friction =
      Vec3::Zero();  ///< N/N, increase of the limit per force of the inside bodies on the outside body
};

inline constexpr std::size_t kMostGhostAxes = 3;

/// An outside body that only inside bodies support, and the bodies that it carries, as one rigid body
/// (coupling/schemes/reduced/carried).
struct CarriedBody {
  double mass_kg = 0.0;
  Vec3 centre_m = Vec3::Zero();                             ///< centre of mass, relative to the outside body's centre
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();  ///< about the centre of mass, world axes
  Wrench drive;  ///< of everything but the inside bodies, at the outside body's centre
};
bool fields(auto& archive, Is<CarriedBody> auto& m) {
  return archive("mass_kg", m.mass_kg) && archive.check(m.mass_kg > 0.0) && archive("centre_m", m.centre_m) &&
         archive("inertia_kg_m2", m.inertia_kg_m2) && archive("drive", m.drive);
}

/// The reduced model of an outside body that touches inside bodies, or soon may (coupling/schemes/reduced).
struct GhostModel {
  BodyId outside{};
  double mass_kg = 0.0;
  Vec3 load_n = Vec3::Zero();  ///< of the inside bodies on it, friction included, mean over the world's step
  std::size_t axis_count = 0;
  std::array<GhostAxis, kMostGhostAxes> axes;  ///< the most heavily loaded first
  /// If set, the ghost moves by this; the axes then only give the contact points' directions.
  std::optional<CarriedBody> carried = {};
  bool approaching = false;  ///< touches no member yet; collides with ghosts too
};

/// Another user who pushes the outside towards the sub-world, along an axis of a ghost.
struct GhostPeer {
  BodyId outside{};        ///< of the ghost
  std::uint32_t axis = 0;  ///< of the ghost, 0 .. kMostGhostAxes - 1
  BodyId proxy{};          ///< of the user
  double offset_m = 0.0;   ///< of the proxy from the outside body, along the axis
};
bool fields(auto& archive, Is<GhostPeer> auto& m) {
  return archive("outside", m.outside) && archive("axis", m.axis) && archive.check(m.axis < kMostGhostAxes) &&
         archive("proxy", m.proxy) && archive("offset_m", m.offset_m);
}

}  // namespace subworld
