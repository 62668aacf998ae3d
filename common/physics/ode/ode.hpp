#pragma once

#include "physics/engine.hpp"

namespace subworld {

/// ODE 0.16 in double precision, with its iterative solver (QuickStep). Presets: `fast` (20 iterations, one sub-step)
/// for a heap at haptic rates, and `quality` (60 iterations, sub-steps of at most 1 ms): QuickStep starts from zero at
/// every step, so tall stacks need short steps as much as iterations. Throws `Error` (usage) for any other preset.
[[nodiscard]] std::unique_ptr<Engine> make_ode(const EngineSettings& settings, std::span<const Mesh> meshes);

}  // namespace subworld
