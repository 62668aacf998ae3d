#pragma once

#include "coupling/schemes/sub_world_side.hpp"
#include "model/messages/exchange.hpp"

#include <array>

namespace subworld {

/// The couplings of other users behind an axis of a ghost, for one linearly implicit step
/// (coupling/tool/virtual_coupling).
struct AxisSpring {
  double force_n = 0.0;   ///< K (x_d - x_p) + B v_d, along the axis
  double added_kg = 0.0;  ///< dt (B + dt K)
};

/// That of one user whose proxy is at `proxy_m` along the axis `normal` and moves there at `speed_m_s`. The proxy
/// pushes and does not pull; at the device's limit it is a constant force.
[[nodiscard]] AxisSpring push_of(const PeerPull& peer, const Vec3& normal, double proxy_m, double speed_m_s,
                                 double dt) noexcept;

/// A ghost while it runs: a point mass with friction along its axes, the world's body across them. What it feels is a
/// contraction, so an outside that sticks stays where it is.
struct GhostMotion {
  GhostModel model;
  Vec3 world_velocity = Vec3::Zero();  ///< m/s, of the world's body
  Vec3 load_n = Vec3::Zero();          ///< of the inside on it, in the last step
  std::array<AxisSpring, kMostGhostAxes> springs = {};

  /// In the engine: the model's, with what the springs add.
  [[nodiscard]] double mass_kg() const noexcept;
  /// The part of a vector along the axes.
  [[nodiscard]] Vec3 along(const Vec3& v) const noexcept;
  /// The force that drives it, N.
  [[nodiscard]] Vec3 force() const noexcept;
  /// The velocity with which the step begins: friction works against what the last step's load would do. `spare_n`: by
  /// how much a load may exceed the world's; a wall gives way to a larger one (coupling/README.md, Walls).
  [[nodiscard]] Vec3 begin(const Vec3& velocity, double dt, double spare_n) const noexcept;
  /// After the step, with the velocity it began and ended with.
  void end(const Vec3& before, const Vec3& after, double dt) noexcept;
};

}  // namespace subworld
