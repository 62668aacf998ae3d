#include "io/options/scene_name.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/places.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>
#include <system_error>
#include <vector>

namespace subworld {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kExtension = ".yaml";

std::vector<std::string> scene_names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == kExtension) names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}

}  // namespace

std::string scene_file(const std::string& scene) {
  const fs::path folder = data_folder("scenes");
  std::error_code unreadable;  // reading the file reports the reason
  const bool is_file = fs::exists(scene, unreadable) && !fs::is_directory(scene, unreadable);
  if (is_file || folder.empty() || scene.find('/') != std::string::npos) return scene;
  const std::vector<std::string> names = scene_names(folder);
  if (std::ranges::find(names, scene) != names.end()) return (folder / (scene + std::string(kExtension))).string();
  const std::string word = scene.ends_with(kExtension) ? scene.substr(0, scene.size() - kExtension.size()) : scene;
  const std::string_view near = nearest(word, {names.begin(), names.end()});
  throw Error(ExitCode::usage,
              fmt::format("\"{}\" is neither a file nor the name of a scene in {}; {}", scene, folder.string(),
                          near.empty() ? fmt::format("those are {}", joined(names, ", "))
                                       : fmt::format("did you mean \"{}\"?", near)));
}

}  // namespace subworld
