#include "physics/plugin.hpp"

#include "model/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace subworld {

std::size_t find_preset(const EnginePlugin& plugin, std::string_view name) {
  std::vector<std::string_view> known;
  for (std::size_t i = 0; i < plugin.presets.size(); ++i) {
    if (plugin.presets[i].name == name) return i;
    known.push_back(plugin.presets[i].name);
  }
  throw Error(ExitCode::usage, fmt::format("engine {} has no preset \"{}\"; choose one of: {}", plugin.name, name,
                                           fmt::join(known, ", ")));
}

int substep_count(double dt, std::optional<int> fixed, double longest_s) noexcept {
  return fixed.value_or(std::max(1, static_cast<int>(std::ceil(dt / longest_s))));
}

}  // namespace subworld
