#include "plugin/library.hpp"

#include "model/error.hpp"
#include "model/places.hpp"

#include <dlfcn.h>
#include <fmt/core.h>

#include <cstdlib>
#include <ranges>
#include <vector>

namespace subworld {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSuffix = ".so";

std::vector<fs::path> folders_of(const PluginKind& kind) {
  std::vector<fs::path> folders;
  if (const char* listed = std::getenv(kind.folders_variable)) {
    for (const auto folder : std::views::split(std::string_view(listed), ':')) {
      if (!folder.empty()) folders.emplace_back(folder.begin(), folder.end());
    }
  }
  folders.push_back(program_folder());
  return folders;
}

template <typename Function>
Function* exported(void* library, const std::string& symbol) {
  return reinterpret_cast<Function*>(dlsym(library, symbol.c_str()));
}

}  // namespace

std::map<std::string, fs::path, std::less<>> plugin_files(const PluginKind& kind) {
  std::map<std::string, fs::path, std::less<>> files;
  for (const fs::path& folder : folders_of(kind)) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      const std::string file = entry.path().filename().string();
      if (!file.starts_with(kind.prefix) || !file.ends_with(kSuffix)) continue;
      files.emplace(file.substr(kind.prefix.size(), file.size() - kind.prefix.size() - kSuffix.size()), entry.path());
    }
  }
  return files;
}

std::vector<std::string> plugin_names(const PluginKind& kind) {
  std::vector<std::string> names;
  for (const auto& [name, file] : plugin_files(kind)) names.push_back(name);
  return names;
}

const void* load_plugin(const PluginKind& kind, const std::string& name, const fs::path& file) {
  // RTLD_LOCAL: two plug-ins may define the same symbols, as Bullet's two precisions do.
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    throw Error(ExitCode::usage, fmt::format("{} \"{}\" cannot be loaded: {}; install what is missing or build it "
                                             "again with deploy/build",
                                             kind.noun, name, dlerror()));
  }
  const std::string entry = kind.entry;
  auto* plugin = exported<const void*()>(library, entry);
  auto* interface = exported<int()>(library, entry + "_interface");
  auto* compiler = exported<const char*()>(library, entry + "_compiler");
  if (plugin == nullptr || interface == nullptr || compiler == nullptr) {
    throw Error(ExitCode::usage, fmt::format("{} is not {} of Subworld: it exports no {}; remove it or build it as {} "
                                             "shows",
                                             file.string(), kind.with_article, entry, kind.page));
  }
  if (interface() != kind.interface || std::string_view(compiler()) != __VERSION__) {
    throw Error(ExitCode::usage,
                fmt::format("{} is of another build (interface {}, compiler {}; this program: {}, {}); build both "
                            "together",
                            file.string(), interface(), compiler(), kind.interface, __VERSION__));
  }
  return plugin();
}

}  // namespace subworld
