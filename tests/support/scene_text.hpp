#pragma once

#include "model/error.hpp"
#include "model/scene.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace subworld {

/// A folder of its own for each test, gone at its end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "subworld_scene_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string write(const std::string& name, const std::string& text) const {
    const std::filesystem::path file = path_ / name;
    std::ofstream(file, std::ios::binary) << text;
    return file.string();
  }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

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
