#include "model/places.hpp"

#include <system_error>

/// The folder of Subworld's programs, for what lies elsewhere: defined in programs that are built with an installation
/// (deploy/installed_programs.cpp), and in the module of Python.
extern "C" __attribute__((weak)) const char* subworld_installed_programs();

namespace subworld {

namespace fs = std::filesystem;

fs::path program_folder() {
  if (subworld_installed_programs != nullptr) return subworld_installed_programs();
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).parent_path();
}

fs::path data_folder(std::string_view name) {
  std::error_code unreadable;
  for (fs::path above = program_folder(); above.has_relative_path(); above = above.parent_path()) {
    for (const char* place : {"share/subworld", "deploy"}) {
      if (fs::path folder = above / place / name; fs::is_directory(folder, unreadable)) return folder;
    }
  }
  return {};
}

}  // namespace subworld
