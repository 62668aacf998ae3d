#include "lab/network/criteria.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>

namespace subworld {

namespace {

/// Calls `use` with the name and the value of each column, as in the CSV file.
template <class Use>
void for_each_column(const Json& row, Use use) {
  for (const auto& [key, value] : row.items()) {
    if (!value.is_object()) {
      use(key, value);
      continue;
    }
    for (const auto& [part, inner] : value.items()) use(key + "_" + part, inner);
  }
}

}  // namespace

double value_of(const Json& row, const std::string& column) {
  double found = std::numeric_limits<double>::quiet_NaN();
  for_each_column(row, [&](const std::string& name, const Json& value) {
    if (name == column && value.is_number()) found = value.get<double>();
  });
  return found;
}

Requirement parse_requirement(const std::string& text, const Json& example) {
  const std::size_t at = text.find_first_of("<>");
  char* end = nullptr;
  const double bound = at == std::string::npos ? 0.0 : std::strtod(text.c_str() + at + 1, &end);
  if (at == std::string::npos || at == 0 || end == text.c_str() + at + 1 || *end != 0 || !std::isfinite(bound)) {
    throw Error(ExitCode::usage,
                fmt::format("--require {}: use COLUMN<NUMBER or COLUMN>NUMBER, such as round_trip_s_p99<0.02", text));
  }
  const std::string column = text.substr(0, at);
  std::vector<std::string> names;
  for_each_column(example, [&](const std::string& name, const Json& value) {
    if (!value.is_string()) names.push_back(name);
  });
  for (const std::string& name : names) {
    if (name == column) return {text, column, text[at], bound};
  }
  throw Error(ExitCode::usage, fmt::format("--require {}: there is no column {} with numbers; use one of {}", text,
                                           column, joined(names, ", ")));
}

bool holds(const Requirement& requirement, const Json& row) {
  const double value = value_of(row, requirement.column);
  return requirement.relation == '<' ? value < requirement.bound : value > requirement.bound;
}

std::vector<Requirement> those_of(const Json& row, const std::vector<Requirement>& requirements) {
  std::set<std::string> names;
  for_each_column(row, [&](const std::string& name, const Json&) { names.insert(name); });
  std::vector<Requirement> found = requirements;
  std::erase_if(found, [&](const Requirement& one) { return !names.contains(one.column); });
  return found;
}

std::vector<std::string> missed_by(const Json& row, const std::vector<Requirement>& requirements) {
  std::vector<std::string> missed;
  for (const Requirement& one : requirements) {
    if (holds(one, row)) continue;
    const double value = value_of(row, one.column);
    missed.push_back(std::isfinite(value)
                         ? fmt::format("{}: it is {:.4g}", one.text, value)
                         : fmt::format("{}: it was not measured; a longer --duration may help", one.text));
  }
  return missed;
}

}  // namespace subworld
