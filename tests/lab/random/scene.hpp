#pragma once

#include "model/scene.hpp"

#include <cstdint>

namespace subworld {

/// The scene of this number among those of the seed: always the same. Any shapes, structures, users, devices and
/// couplings that a scene file may hold; without deep overlap, so that nothing but the scene's own energy is there at
/// the begin. Small: a run of it takes about a tenth of a second.
[[nodiscard]] Scene random_scene(std::uint64_t seed, std::uint64_t index);

/// Deepest penetration at the begin, m, and the two bodies' names; as the engine `bullet` finds it.
struct Overlap {
  double depth_m = 0.0;
  BodyId a{}, b{};
};
[[nodiscard]] Overlap deepest_overlap(const Scene& scene);

}  // namespace subworld
