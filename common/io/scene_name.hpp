#pragma once

#include <filesystem>
#include <string>

namespace subworld {

/// deploy/scenes of the checkout that this program was built in; empty where there is none.
[[nodiscard]] std::filesystem::path scenes_folder();

/// The file of a scene that a command line gives by its path, or by its name in the scenes folder. A file wins. Throws
/// `Error` (usage) for a name of neither, with the nearest one.
[[nodiscard]] std::string scene_file(const std::string& scene);

}  // namespace subworld
