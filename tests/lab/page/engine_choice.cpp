#include "lab/page/engine_choice.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"
#include "physics/plugin.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace subworld {

namespace {

constexpr double kShortestStep_s = 1e-5;
constexpr double kLongestStep_s = 0.1;
constexpr std::array kDisplayOrder{"havok", "physx", "bullet"};

}  // namespace

std::vector<std::string> in_display_order(std::vector<std::string> engines) {
  const auto rank = [](const std::string& name) {
    const auto known = std::ranges::find(kDisplayOrder, name);
    return std::pair(known - kDisplayOrder.begin(), name);
  };
  std::ranges::sort(engines, {}, rank);
  return engines;
}

std::vector<std::string> presets_of(const std::vector<std::string>& asked, const std::string& engine) {
  const EnginePlugin& plugin = engine_plugin(engine);
  for (const std::string& preset : asked) (void)find_preset(plugin, preset);
  if (!asked.empty()) return asked;
  std::vector<std::string> presets;
  for (const EnginePreset& preset : plugin.presets) presets.emplace_back(preset.name);
  return presets;
}

Json engines_json(const std::vector<std::string>& engines) {
  Json all = Json::array();
  for (const std::string& name : engines) {
    const EnginePlugin& plugin = engine_plugin(name);
    Json presets = Json::object();
    for (const EnginePreset& preset : plugin.presets) presets[std::string(preset.name)] = preset.what;
    all.push_back(
        {{"engine", plugin.name}, {"version", plugin.version}, {"licence", plugin.licence}, {"presets", presets}});
  }
  return all;
}

std::string engines_text(const std::vector<std::string>& engines) {
  std::string text;
  for (const std::string& name : engines)
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", name, engine_plugin(name).version);
  return text;
}

double step_of(const std::string& text) {
  char* end = nullptr;
  double value = std::strtod(text.c_str(), &end);
  if (*end == '/') {
    const char* parts = end + 1;
    value /= std::strtod(parts, &end);
    if (end == parts) end = const_cast<char*>(text.c_str());
  }
  if (end == text.c_str() || *end != '\0' || !(value >= kShortestStep_s && value <= kLongestStep_s)) {
    throw Error(ExitCode::usage, fmt::format("--dt {}: not a time step; write seconds from {:g} to {:g}, as in 1/60 or "
                                             "0.01",
                                             text, kShortestStep_s, kLongestStep_s));
  }
  return value;
}

std::string step_text(double dt_s) {
  const double parts = std::round(1.0 / dt_s);
  return std::abs(parts * dt_s - 1.0) < 1e-6 ? fmt::format("1/{:g}", parts) : fmt::format("{:g}", dt_s);
}

std::string setting_of(const Json& row) {
  const auto preset = row.at("preset").get<std::string>();
  return row.at("engine").get<std::string>() + (preset.empty() ? "" : " " + preset);
}

std::vector<std::string> settings_of(const Rows& rows) {
  std::vector<std::string> settings;
  for (const Json& row : rows) {
    if (std::ranges::find(settings, setting_of(row)) == settings.end()) settings.push_back(setting_of(row));
  }
  return settings;
}

}  // namespace subworld
