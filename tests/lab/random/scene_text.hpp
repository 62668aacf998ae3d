#pragma once

#include "model/scene/scene.hpp"

#include <string>

/// Conversion of a scene to a scene file.
namespace subworld {

/// YAML text of a scene, from which `load_scene` reads the same scene: numbers bit by bit, rotations to the last bit or
/// two, meshes to single precision. Names from a repetition lose their slashes.
[[nodiscard]] std::string scene_text(const Scene& scene);

/// Writes `folder`/NAME.yaml, and beside it the meshes as NAME_0.obj and so on. Returns the path of the scene.
/// Throws `Error` (failed).
std::string write_scene(const Scene& scene, const std::string& folder);

/// The scene after writing and reading it: equal to a saved file to the last bit. Throws `Error`.
[[nodiscard]] Scene as_written(const Scene& scene, const std::string& folder);

}  // namespace subworld
