#include "lab/stability/plan.hpp"

#include "io/results/json.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/page/tables.hpp"
#include "lab/stability/cases/cases.hpp"
#include "model/error.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

namespace subworld {

namespace {

std::string label_text(const std::string& name, std::optional<double> value, const std::string& unit) {
  if (!value) return name;
  return fmt::format("{}, {:g}{}{}", name, *value, unit.empty() ? "" : " ", unit);
}

/// Group names, then case names.
std::vector<std::string_view> known_names() {
  std::vector<std::string_view> names;
  for (const StabilityCase& one : stability_cases()) {
    if (std::ranges::find(names, one.group) == names.end()) names.emplace_back(one.group);
  }
  for (const StabilityCase& one : stability_cases()) names.emplace_back(one.name);
  return names;
}

std::vector<double> steps_of(const StabilityRequest& request) {
  if (!request.steps_s.empty()) return request.steps_s;
  if (request.quick) return {std::begin(kQuickStabilitySteps_s), std::end(kQuickStabilitySteps_s)};
  return {std::begin(kStabilitySteps_s), std::end(kStabilitySteps_s)};
}

void add_points(const StabilityCase& one, const EngineSetting& setting, bool quick,
                std::vector<StabilityPoint>& points) {
  if (quick && one.quick_values == 0) return;
  if (one.values.empty()) points.push_back({&one, setting, std::nullopt});
  std::vector<double> values = one.values;
  if (quick && values.size() > one.quick_values) values.resize(one.quick_values);
  std::ranges::sort(values);
  for (const double value : values) points.push_back({&one, setting, value});
}

}  // namespace

std::string StabilityPoint::label() const { return label_text(one->name, value, one->parameter_unit); }

std::string label_of(const Json& row) {
  const bool searched = row.at("parameter") == row.at("quantity");
  const auto value = searched || row.at("value").is_null() ? std::nullopt : std::optional(number(row, "value"));
  return label_text(row.at("case"), value, row.at("parameter_unit"));
}

std::vector<const StabilityCase*> chosen_cases(const std::vector<std::string>& names) {
  const std::vector<std::string_view> known = known_names();
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) == known.end()) {
      const std::string_view meant = nearest(name, known);
      throw Error(ExitCode::usage,
                  fmt::format("\"{}\" is neither a case nor a group{} All of them:\n{}", name,
                              meant.empty() ? "." : fmt::format("; did you mean \"{}\"?", meant), cases_text()));
    }
  }
  const auto asked = [&](const std::string& name) { return std::ranges::find(names, name) != names.end(); };
  std::vector<const StabilityCase*> chosen;
  for (const StabilityCase& one : stability_cases()) {
    if (names.empty() || asked(one.name) || asked(one.group)) chosen.push_back(&one);
  }
  return chosen;
}

std::string cases_text() {
  constexpr std::size_t kWidth = 112;
  std::string text, group;
  std::size_t width = 0;
  for (const StabilityCase& one : stability_cases()) {
    const bool same = one.group == group;
    const bool fits = same && width + one.name.size() + 2 < kWidth;
    const std::string before = !same  ? fmt::format("{}  {}: ", text.empty() ? "" : "\n", one.group)
                               : fits ? ", "
                                      : ",\n    ";
    width = (fits ? width : 0) + before.size() + one.name.size();
    text += before + one.name;
    group = one.group;
  }
  return text;
}

std::vector<StabilityPoint> points_of(const StabilityRequest& request) {
  const std::vector<const StabilityCase*> cases = chosen_cases(request.names);
  const std::vector<double> steps_s = steps_of(request);
  std::vector<StabilityPoint> points;
  for (const std::string& engine : request.engines) {
    for (const std::string& preset : presets_of(request.presets, engine)) {
      for (const double dt_s : steps_s) {
        for (const StabilityCase* one : cases) {
          if (one->once || (one->own_step && dt_s != steps_s.front())) continue;
          add_points(*one, {engine, preset, dt_s}, request.quick, points);
        }
      }
    }
  }
  for (const StabilityCase* one : cases) {
    if (one->once)
      add_points(*one, {.engine = "any engine", .preset = "", .dt_s = steps_s.front()}, request.quick, points);
  }
  return points;
}

}  // namespace subworld
