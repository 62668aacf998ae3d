#pragma once

#include "model/scene.hpp"

#include <string>

/// The way back from a scene to its file.
namespace subworld {

/// The scene as YAML that `load_scene` reads back to the same scene: numbers bit by bit, rotations to the last bit or
/// two, meshes to single precision. Names that came from a repetition lose their slashes.
[[nodiscard]] std::string scene_text(const Scene& scene);

/// Writes `folder`/NAME.yaml, and beside it the meshes as NAME_0.obj and so on. Returns the path of the scene.
/// Throws `Error` (failed).
std::string write_scene(const Scene& scene, const std::string& folder);

/// What a reader makes of the scene's text: what a kept file holds, down to the last bit. Throws `Error`.
[[nodiscard]] Scene as_written(const Scene& scene, const std::string& folder);

}  // namespace subworld
