#include "lab/analysis.hpp"

#include "lab/measure.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

namespace subworld {

namespace {

/// What is asked of a scheme, whatever it does about it.
const std::vector<std::string> kConditions{"scene", "engine", "h_s", "latency_s", "jitter_s", "coupling_stiffness_n_m"};
/// What is run, but for how long and how late.
const std::vector<std::string> kSetting{"scene", "scheme", "engine",        "haptic_engine",  "h_s",
                                        "ratio", "box_m",  "contact_depth", "world_substeps", "coupling_stiffness_n_m"};

double number(const Json& row, const char* key) { return row.at(key).get<double>(); }

/// Under a telling floor nothing can be told apart.
double told_error(const Json& row) {
  const double floor = number(row, "reference_floor");
  const double rms = number(row, "force_error_rms");
  return telling(floor) ? std::max(rms, floor) : rms;
}

bool ranked(const Json& row) { return row.at("survived").get<bool>() && comparable(row); }

bool fits(const Json& row) {
  return ranked(row) && !row.at("at_floor").get<bool>() && number(row, "latency_s") == 0.0 &&
         number(row, "jitter_s") == 0.0 && number(row, "force_error_rms") > 0.0;
}

/// Least squares y = a + p x.
struct Line {
  double sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
  int count = 0;
  void add(double x, double y) {
    sum_x += x;
    sum_y += y;
    sum_xx += x * x;
    sum_xy += x * y;
    ++count;
  }
  [[nodiscard]] double spread() const { return count * sum_xx - sum_x * sum_x; }
  [[nodiscard]] double slope() const { return (count * sum_xy - sum_x * sum_y) / spread(); }
  [[nodiscard]] double offset() const { return (sum_y - slope() * sum_x) / count; }
};

std::string cell(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) {
    const double number = value.get<double>();
    return std::isfinite(number) ? fmt::format("{}", number) : "";
  }
  return value.dump();
}

}  // namespace

bool comparable(const Json& row) {
  return std::isfinite(number(row, "force_error_rms")) && std::isfinite(number(row, "reference_floor"));
}

bool imperceptible(const Json& row) {
  return ranked(row) && number(row, "force_error_rms") <= kImperceptibleRms &&
         number(row, "force_error_p99") <= kImperceptibleP99 &&
         std::abs(number(row, "time_offset_s")) <= kImperceptibleOffset_s;
}

bool alike(const Json& a, const Json& b, const std::vector<std::string>& columns) {
  return std::ranges::all_of(columns, [&](const std::string& c) { return a.at(c) == b.at(c); });
}

bool dominated(const Json& row, const Rows& rows) {
  if (!ranked(row)) return !row.at("survived").get<bool>();
  return std::ranges::any_of(rows, [&](const Json& other) {
    if (!alike(row, other, kConditions) || !ranked(other)) return false;
    const double less_error = told_error(row) - told_error(other);
    const double less_cpu = total_cpu(row) - total_cpu(other);
    return less_error >= 0.0 && less_cpu >= 0.0 && less_error + less_cpu > 0.0;
  });
}

const Json* choice(const std::vector<const Json*>& rows, double budget) {
  const Json* best = nullptr;
  for (const Json* row : rows) {
    if (!ranked(*row) || total_cpu(*row) > budget) continue;
    const auto rank = [](const Json& of) { return std::pair{told_error(of), total_cpu(of)}; };
    if (best == nullptr || rank(*row) < rank(*best)) best = row;
  }
  return best;
}

Json convergence(const Rows& rows, const std::string& x) {
  std::vector<std::string> fixed = kSetting;
  std::erase(fixed, x);
  Json fitted = Json::array();
  for (const Json& row : rows) {
    if (std::ranges::any_of(fitted, [&](const Json& done) { return alike(done, row, fixed); })) continue;
    Line line;
    for (const Json& other : rows) {
      if (!alike(row, other, fixed) || !fits(other)) continue;
      line.add(std::log(number(other, x.c_str())), std::log(number(other, "force_error_rms")));
    }
    Json fit;
    for (const std::string& column : fixed) fit[column] = row.at(column);
    fit["in"] = x;
    fit["points"] = line.count;
    const bool known = line.count >= 2 && line.spread() > 1e-12;
    fit["order"] = known ? Json(line.slope()) : Json(nullptr);
    fit["factor"] = known ? Json(std::exp(line.offset())) : Json(nullptr);
    fitted.push_back(fit);
  }
  return fitted;
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

}  // namespace subworld
