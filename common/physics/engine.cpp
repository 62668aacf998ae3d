#include "physics/engine.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"
#include "physics/plugin.hpp"
#include "physics/scaled_engine.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <ranges>
#include <string>

namespace subworld {

namespace {

namespace fs = std::filesystem;

constexpr const char* kFoldersVariable = "SUBWORLD_ENGINES";
constexpr std::string_view kPrefix = "libsubworld_engine_";
constexpr std::string_view kSuffix = ".so";

/// Engines that are not in a default build.
constexpr std::array<std::string_view, 3> kOptional{"havok", "physx", "rapier"};

/// Folders of the engines' libraries: those of the environment variable, then the program's folder.
std::vector<fs::path> engine_folders() {
  std::vector<fs::path> folders;
  if (const char* listed = std::getenv(kFoldersVariable)) {
    for (const auto folder : std::views::split(std::string_view(listed), ':')) {
      if (!folder.empty()) folders.emplace_back(folder.begin(), folder.end());
    }
  }
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (!program.empty()) folders.push_back(program.parent_path());
  return folders;
}

/// Name -> library; the first folder that has one takes precedence.
std::map<std::string, fs::path, std::less<>> engine_files() {
  std::map<std::string, fs::path, std::less<>> files;
  for (const fs::path& folder : engine_folders()) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
      const std::string file = entry.path().filename().string();
      if (!file.starts_with(kPrefix) || !file.ends_with(kSuffix)) continue;
      files.emplace(file.substr(kPrefix.size(), file.size() - kPrefix.size() - kSuffix.size()), entry.path());
    }
  }
  return files;
}

template <typename Function>
Function* exported(void* library, const char* symbol) {
  return reinterpret_cast<Function*>(dlsym(library, symbol));
}

/// A library is never unloaded, because its code serves every engine that it made.
const EnginePlugin& load(const std::string& name, const fs::path& file) {
  // RTLD_LOCAL: two engines may define the same symbols, as Bullet's two precisions do.
  void* library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) {
    throw Error(ExitCode::usage, fmt::format("engine \"{}\" cannot be loaded: {}; install what is missing or build it "
                                             "again with deploy/build",
                                             name, dlerror()));
  }
  auto* plugin = exported<const EnginePlugin*()>(library, "subworld_engine_plugin");
  auto* interface = exported<int()>(library, "subworld_engine_plugin_interface");
  auto* compiler = exported<const char*()>(library, "subworld_engine_plugin_compiler");
  if (plugin == nullptr || interface == nullptr || compiler == nullptr) {
    throw Error(ExitCode::usage,
                fmt::format("{} is not an engine of Subworld: it exports no subworld_engine_plugin; remove it "
                            "or build it as common/physics/README.md shows",
                            file.string()));
  }
  if (interface() != kEnginePluginInterface || std::string_view(compiler()) != __VERSION__) {
    throw Error(ExitCode::usage,
                fmt::format("{} is of another build (interface {}, compiler {}; this program: {}, {}); build both "
                            "together",
                            file.string(), interface(), compiler(), kEnginePluginInterface, __VERSION__));
  }
  return *plugin();
}

}  // namespace

std::vector<std::string> engine_names() {
  std::vector<std::string> names;
  for (const auto& [name, file] : engine_files()) names.push_back(name);
  return names;
}

const EnginePlugin& engine_plugin(std::string_view name) {
  static std::mutex mutex;
  static std::map<std::string, const EnginePlugin*, std::less<>> loaded;
  const std::lock_guard lock(mutex);
  if (const auto known = loaded.find(name); known != loaded.end()) return *known->second;

  const auto files = engine_files();
  if (const auto file = files.find(name); file != files.end()) {
    return *(loaded[file->first] = &load(file->first, file->second));
  }
  if (std::ranges::find(kOptional, name) != kOptional.end()) {
    throw Error(ExitCode::usage, fmt::format("engine \"{}\" is not in this build; build it by "
                                             "SUBWORLD_ENGINES_ALL=1 deploy/build",
                                             name));
  }
  const std::vector<std::string> names = engine_names();
  const std::string_view meant = nearest(name, {names.begin(), names.end()});
  throw Error(ExitCode::usage,
              fmt::format("engine \"{}\" is unknown; {}choose one of: {}", name,
                          meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant), fmt::join(names, ", ")));
}

StepCost EngineCost::step(double dt) const noexcept {
  const double count = substep_count(dt, substeps, longest_substep_s);
  const double each = iteration_count(dt / count, iterations, least_iterations, longest_iteration_s);
  return {count * substep.step_s, count * substep.body_s, count * (substep.contact_s + each * contact_iteration_s)};
}

EngineCost engine_cost(const EngineSettings& settings) {
  const EnginePlugin& plugin = engine_plugin(settings.name);
  const EnginePreset& preset = plugin.presets[find_preset(plugin, settings.preset)];
  const SubstepCost& cost = preset.cost;
  return {.substep = {cost.step_s, cost.body_s, cost.contact_s},
          .contact_iteration_s = cost.contact_iteration_s,
          .substeps = settings.substeps,
          .longest_substep_s = settings.longest_substep_s.value_or(preset.longest_substep_s),
          .iterations = settings.iterations,
          .least_iterations = preset.iterations,
          .longest_iteration_s = preset.longest_iteration_s};
}

std::unique_ptr<Engine> make_engine(const EngineSettings& settings, std::span<const Mesh> meshes) {
  const EnginePlugin& plugin = engine_plugin(settings.name);
  const double unit_m = settings.length_unit_m;
  if (unit_m == 1.0) return plugin.make(settings, meshes);
  return std::make_unique<ScaledEngine>(plugin.make(scaled(settings, unit_m), scaled(meshes, unit_m)), unit_m);
}

}  // namespace subworld
