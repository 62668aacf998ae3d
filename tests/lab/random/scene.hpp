#pragma once

#include "model/scene/scene.hpp"

#include <cstdint>

namespace subworld {

/// The scene with this number for this seed; always the same. It has any shapes, structures, users, devices and
/// couplings that a scene file permits. Bodies do not overlap deeply, so the energy at the start is only that of the
/// scene. A run takes about a tenth of a second.
[[nodiscard]] Scene random_scene(std::uint64_t seed, std::uint64_t index);

/// Deepest penetration at the start, m, and the names of the two bodies, as computed by the engine `bullet`.
struct Overlap {
  double depth_m = 0.0;
  BodyId a{}, b{};
};
[[nodiscard]] Overlap deepest_overlap(const Scene& scene);

}  // namespace subworld
