#pragma once

#include "model/scene.hpp"

namespace subworld {

struct Variation {
  double friction = 1.0;  ///< times the scene's
  double mass = 1.0;      ///< times the scene's
  Quat turn = Quat::Identity();
  double stretch = 1.0;        ///< times the paths
  Vec3 across = Vec3::Zero();  ///< what the longest move is crossed with to go aside
  double aside = 0.0;          ///< part of the longest move
};
/// Always the same for the same number; none for 0.
[[nodiscard]] Variation variation(int variant);

/// The scene as somebody else might have made it, to see whether an error is that of one lucky scene: friction 0.8 to
/// 1.25 times as large, movable bodies but proxies 0.7 to 1.4 times as heavy, and paths of all users turned by up to 6
/// degrees, stretched by 0.85 to 1.2 and begun aside by up to 8 % of the longest move. Each variant > 0 is always the
/// same; 0 is the scene itself.
[[nodiscard]] Scene varied(Scene scene, int variant);

}  // namespace subworld
