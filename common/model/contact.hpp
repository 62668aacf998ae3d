#pragma once

#include "model/types.hpp"

namespace subworld {

/// One contact point of one engine step, or a joint. Impulses are totals over all sub-steps.
struct Contact {
  BodyId a{};
  BodyId b{};
  Vec3 point = Vec3::Zero();               ///< m, on the surface of b
  Vec3 normal = Vec3::UnitZ();             ///< unit, from b to a; zero: a joint
  double distance = 0.0;                   ///< m, negative: penetration
  double normal_impulse = 0.0;             ///< on a along `normal`, total over the step, N s
  Vec3 tangential_impulse = Vec3::Zero();  ///< on a, total over the step, N s; of a joint, its whole impulse

  [[nodiscard]] bool is_joint() const noexcept { return normal.isZero(0.0); }
};

}  // namespace subworld
