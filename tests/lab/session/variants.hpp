#pragma once

#include "model/scene/scene.hpp"

namespace subworld {

struct Variation {
  double friction = 1.0;  ///< relative to the scene's
  double mass = 1.0;      ///< relative to the scene's
  Quat turn = Quat::Identity();
  double stretch = 1.0;        ///< of the paths
  Vec3 across = Vec3::Zero();  ///< the sideways move is along the cross product of this and the longest move
  double aside = 0.0;          ///< relative to the longest move
};
/// Always the same for the same number; no variation for 0.
[[nodiscard]] Variation variation(int variant);

/// A variation of a scene, to check that an error is not specific to it. Friction is 0.8 to 1.25 times as large.
/// Movable bodies but proxies are 0.7 to 1.4 times as heavy. The paths of all users are turned by up to 6 degrees,
/// stretched by 0.85 to 1.2, and begin with a sideways move of up to 8 % of the longest move. Each variant > 0 is
/// always the same; 0 is the scene itself.
[[nodiscard]] Scene varied(Scene scene, int variant);

}  // namespace subworld
