#pragma once

#include "physics/engine.hpp"

namespace subworld {

/// Bullet 3.24 in double precision. Presets: `fast` (10 iterations, one sub-step) and `quality` (50 iterations,
/// sub-steps of at most 2.1 ms, contacts that break early and a split impulse from the first micron: holds tall stacks
/// and card houses). Throws `Error` (usage) for any other preset.
[[nodiscard]] std::unique_ptr<Engine> make_bullet(const EngineSettings& settings, std::span<const Mesh> meshes);

}  // namespace subworld
