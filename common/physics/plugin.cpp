#include "physics/plugin.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace subworld {

std::size_t find_preset(const EnginePlugin& plugin, std::string_view name) {
  std::vector<std::string_view> known;
  for (std::size_t i = 0; i < plugin.presets.size(); ++i) {
    if (plugin.presets[i].name == name) return i;
    known.push_back(plugin.presets[i].name);
  }
  throw Error(ExitCode::usage,
              fmt::format("engine {} has no preset \"{}\"; choose one of: {}", plugin.name, name, joined(known, ", ")));
}

double heaviest_on_light(const HeavyOnLight& ratio, double dt) noexcept {
  if (!std::isfinite(ratio.at_1_ms) || !std::isfinite(ratio.at_4_ms)) return std::numeric_limits<double>::infinity();
  const double exponent = std::log(ratio.at_4_ms / ratio.at_1_ms) / std::log(4.0);
  return ratio.at_1_ms * std::pow(1e3 * dt, exponent);
}

int substep_count(double dt, std::optional<int> fixed, double longest_s) noexcept {
  return iteration_count(dt, fixed, 1, longest_s);
}

int iteration_count(double h, std::optional<int> fixed, int least, double longest_s) noexcept {
  return fixed.value_or(std::max(least, static_cast<int>(std::ceil(h / longest_s))));
}

}  // namespace subworld
