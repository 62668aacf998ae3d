#pragma once

#include <string>

namespace subworld {

/// The file of a scene that a command line gives by its path, or by its name in the scenes folder. An existing file
/// takes precedence. Throws `Error` (usage) if there is neither, with the nearest name.
[[nodiscard]] std::string scene_file(const std::string& scene);

}  // namespace subworld
