#pragma once

#include "physics/engine.hpp"

namespace subworld {

/// Havok 1.3.14 in single precision. A plane is a box of 100 m side and 10 m depth. Presets: `fast`, one sub-step
/// whatever the step; `quality`, sub-steps of at most 1 ms. The number of iterations is Havok's own. Throws `Error`
/// (usage) for an unknown preset and where iterations are asked for.
[[nodiscard]] std::unique_ptr<Engine> make_havok(const EngineSettings& settings, std::span<const Mesh> meshes);

}  // namespace subworld
