#pragma once

#include "model/error.hpp"
#include "model/scene.hpp"
#include "support/temporary_folder.hpp"

#include <string>

namespace subworld {

/// The message with which a file is refused, the folder's path cut off; empty if it loads.
inline std::string refusal(const std::string& file, const std::string& folder) {
  try {
    (void)load_scene(file);
    return "";
  } catch (const Error& e) {
    std::string message = e.what();
    const std::string prefix = folder + "/";
    if (message.starts_with(prefix)) message.erase(0, prefix.size());
    return e.code() == ExitCode::usage ? message : "wrong exit code: " + message;
  }
}

inline Scene load_text(const std::string& text) {
  const TemporaryFolder folder;
  return load_scene(folder.write("scene.yaml", text));
}

}  // namespace subworld
