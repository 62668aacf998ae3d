#include "physics/engine.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"
#include "physics/plugin.hpp"
#include "physics/shells/scaled_engine.hpp"
#include "plugin/library.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <string>

namespace subworld {

namespace {

constexpr PluginKind kEngines{.noun = "engine",
                              .with_article = "an engine",
                              .prefix = "libsubworld_engine_",
                              .folders_variable = "SUBWORLD_ENGINES",
                              .entry = "subworld_engine_plugin",
                              .interface = kEnginePluginInterface,
                              .page = "common/physics/README.md"};

/// Engines that are not in a default build.
constexpr std::array<std::string_view, 3> kOptional{"havok", "physx", "rapier"};

}  // namespace

std::vector<std::string> engine_names() { return plugin_names(kEngines); }

const EnginePlugin& engine_plugin(std::string_view name) {
  static std::mutex mutex;
  static std::map<std::string, const EnginePlugin*, std::less<>> loaded;
  const std::lock_guard lock(mutex);
  if (const auto known = loaded.find(name); known != loaded.end()) return *known->second;

  const auto files = plugin_files(kEngines);
  if (const auto file = files.find(name); file != files.end()) {
    return *(loaded[file->first] = static_cast<const EnginePlugin*>(load_plugin(kEngines, file->first, file->second)));
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
                          meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant), joined(names, ", ")));
}

StepCost EngineCost::step(double dt) const noexcept {
  const double count = substep_count(dt, substeps, longest_substep_s);
  const double each = iteration_count(dt / count, iterations, least_iterations, longest_iteration_s);
  const double shared = count * (1.0 - parallel_ratio + parallel_ratio / threads);
  return {count * substep.step_s, shared * substep.body_s, shared * (substep.contact_s + each * contact_iteration_s)};
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
          .longest_iteration_s = preset.longest_iteration_s,
          .parallel_ratio = preset.parallel_ratio,
          .threads = settings.threads.value_or(1)};
}

std::unique_ptr<Engine> make_engine(const EngineSettings& settings, std::span<const Mesh> meshes) {
  const EnginePlugin& plugin = engine_plugin(settings.name);
  const double unit_m = settings.length_unit_m;
  if (unit_m == 1.0) return plugin.make(settings, meshes);
  return std::make_unique<ScaledEngine>(plugin.make(scaled(settings, unit_m), scaled(meshes, unit_m)), unit_m);
}

}  // namespace subworld
