#pragma once

#include "model/scene/scene.hpp"

#include <string_view>

namespace subworld::bench {

/// Names of large_world().
inline constexpr std::string_view kLargeWorlds[] = {"basin", "drum", "wall"};

/// About `count` moving boxes of 1 m and 1000 kg:
///   basin  cubes that fall into a basin, as in the scene of that name
///   drum   cubes in a drum of eight sides that a motor turns; needs joints
///   wall   a wall of bricks, and a heavy ball that breaks through it
[[nodiscard]] Scene large_world(std::string_view name, int count);

}  // namespace subworld::bench
