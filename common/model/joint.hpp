#pragma once

#include "model/types.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

namespace subworld {

enum class JointKind : std::uint8_t { fixed, hinge, slider, ball, universal, cylindrical, planar, six };
/// "fixed", "hinge", ...
[[nodiscard]] std::string_view name_of(JointKind kind) noexcept;

/// One of the six directions of a joint. Units: m and N, or rad and N m.
struct JointAxis {
  bool free = false;
  double lower = -INFINITY, upper = INFINITY;
  double friction = 0.0;  ///< Coulomb's
  /// The drive: its force is  -stiffness (x - rest) - damping (v - speed),  at most `most` either way.
  double stiffness = 0.0;
  double damping = 0.0;  ///< infinite: a motor that reaches its speed as far as `most` permits
  double rest = 0.0;
  double speed = 0.0;
  double most = INFINITY;

  [[nodiscard]] bool is_driven() const noexcept { return stiffness > 0.0 || damping > 0.0; }
};

/// Connects two bodies, one of them movable. Each has a frame of the joint. Coordinates are those of a's frame in b's:
/// the place of its origin, along the axes of b's frame, and its turn.
///   no free turn, or a ball: the rotation vector in b's frame
///   one, about axis k:       the angle about k, and about the others how far the two axes k differ
///   two, about i and j:      the angle about b's i, then about a's j; about the third, how far i and j are from square
///   three, of `six`:         the angles about b's x, then y, then a's z; of no use near 90 degrees about y
struct Joint {
  std::string name;
  JointKind kind = JointKind::fixed;
  BodyId a{}, b{};
  Pose in_a, in_b;                ///< the joint's frames, in the bodies' frames
  std::array<JointAxis, 6> axes;  ///< x, y, z, turns about x, y, z
  double break_force_n = INFINITY;
  double break_torque_n_m = INFINITY;
  bool collide = false;  ///< the two bodies collide

  [[nodiscard]] bool joins(BodyId id) const noexcept { return a == id || b == id; }
};

/// Impulses of a joint on its body a in a step, about the joint's point: N s and N m s.
struct JointLoad {
  Vec3 impulse = Vec3::Zero();
  Vec3 turn = Vec3::Zero();
  double motor_j = 0.0;  ///< work of the joint's motors on its bodies

  JointLoad& operator+=(const JointLoad& other) noexcept {
    impulse += other.impulse;
    turn += other.turn;
    motor_j += other.motor_j;
    return *this;
  }
};

/// Where a joint is: m and rad.
struct JointPlace {
  Vec3 point = Vec3::Zero();  ///< origin of a's frame, world frame
  /// World frame: a coordinate's rate is that of a against b along it. Of unit length, but for three turns of `six`.
  std::array<Vec3, 6> directions;
  std::array<double, 6> coordinates{};  ///< of the free axes; of the others how far they are off
};
[[nodiscard]] JointPlace place_of(const Joint& joint, const Pose& a, const Pose& b) noexcept;

[[nodiscard]] bool has_spring(const Joint& joint) noexcept;
/// Energy that the joint's springs store, J.
[[nodiscard]] double spring_energy(const Joint& joint, const Pose& a, const Pose& b) noexcept;

}  // namespace subworld
