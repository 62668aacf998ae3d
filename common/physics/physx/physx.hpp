#pragma once

#include "physics/engine.hpp"

namespace subworld {

/// PhysX 5.6.1 in single precision, solver TGS. Presets: `fast`, 4 iterations and one sub-step whatever the step;
/// `quality`, 8 iterations and sub-steps of at most 1 ms. Throws `Error` (usage) for an unknown preset.
[[nodiscard]] std::unique_ptr<Engine> make_physx(const EngineSettings& settings, std::span<const Mesh> meshes);

}  // namespace subworld
