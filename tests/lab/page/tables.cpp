#include "lab/page/tables.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

namespace subworld {

namespace {

std::string cell(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string() || value.is_array()) {
    std::string text = value.is_string() ? value.get<std::string>() : value.dump();
    if (text.find_first_of(",\"\n") == std::string::npos) return text;
    for (std::size_t at = text.find('"'); at != std::string::npos; at = text.find('"', at + 2)) text.insert(at, 1, '"');
    return '"' + text + '"';
  }
  if (value.is_number_float()) {
    const double number = value.get<double>();
    return std::isfinite(number) ? fmt::format("{}", number) : "";
  }
  return value.dump();
}

}  // namespace

double number(const Json& row, const std::string& column) {
  const Json& value = row.at(column);
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

bool alike(const Json& a, const Json& b, const std::vector<std::string>& columns) {
  return std::ranges::all_of(columns, [&](const std::string& c) { return a.at(c) == b.at(c); });
}

std::vector<Rows> by_scene(const Rows& rows) {
  std::vector<Rows> scenes;
  for (const Json& row : rows) {
    if (scenes.empty() || scenes.back().front().at("scene") != row.at("scene")) scenes.emplace_back();
    scenes.back().push_back(row);
  }
  return scenes;
}

Rows read_rows(const std::string& path) {
  if (!std::filesystem::exists(path)) return {};
  const Json rows = read_json(path);
  if (!rows.is_array()) throw Error(ExitCode::failed, fmt::format("{}: is no table of a lab", path));
  return rows.get<Rows>();
}

void write_csv(const std::string& path, const Rows& rows) {
  std::ofstream file(path);
  const auto each_cell = [](const Json& row, const auto& use) {
    for (const auto& [key, value] : row.items()) {
      if (!value.is_object()) {
        use(key, value);
        continue;
      }
      for (const auto& [part, inner] : value.items()) use(key + "_" + part, inner);
    }
  };
  if (!rows.empty()) {
    std::string line;
    each_cell(rows.front(), [&](const std::string& name, const Json&) {
      line += fmt::format("{}{}", line.empty() ? "" : ",", name);
    });
    file << line << '\n';
  }
  for (const Json& row : rows) {
    std::string line;
    bool first = true;
    each_cell(row, [&](const std::string&, const Json& value) {
      line += fmt::format("{}{}", first ? "" : ",", cell(value));
      first = false;
    });
    file << line << '\n';
  }
  if (!file.flush()) throw Error(ExitCode::failed, fmt::format("{}: cannot write; is the disk full?", path));
}

void LineFit::add(double x, double y) {
  sum_x_ += x;
  sum_y_ += y;
  sum_xx_ += x * x;
  sum_xy_ += x * y;
  sum_yy_ += y * y;
  ++count_;
}

double LineFit::r_squared() const {
  const double covariance = count_ * sum_xy_ - sum_x_ * sum_y_;
  return covariance * covariance / (spread() * y_spread());
}

double LineFit::standard_error() const {
  if (count_ < 3) return std::numeric_limits<double>::quiet_NaN();
  const double unexplained = std::max(0.0, 1.0 - r_squared()) * y_spread();
  return std::sqrt(unexplained / ((count_ - 2) * spread()));
}

}  // namespace subworld
