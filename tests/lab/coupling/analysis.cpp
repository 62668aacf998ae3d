#include "lab/coupling/analysis.hpp"

#include "io/results/json.hpp"
#include "lab/coupling/measure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string_view>

namespace subworld {

namespace {

/// Columns that a method has a choice in; the others are conditions.
constexpr std::array<std::string_view, 8> kOfMethod{"scheme", "haptic_engine", "ratio",        "ratio_most",
                                                    "box_m",  "contact_depth", "budget_ratio", "world_substeps"};

/// Columns of what delays or loses messages.
constexpr std::array<std::string_view, 5> kLinkFaults{"latency_s", "jitter_s", "device_latency_s", "loss_ratio",
                                                      "deadband"};

std::vector<std::string> without(std::vector<std::string> columns, const auto& others) {
  std::erase_if(columns, [&](const std::string& one) { return std::ranges::find(others, one) != std::end(others); });
  return columns;
}

/// Errors below a usable reference error are not significant, so they count as equal.
double significant_error(const Json& row) {
  const double reference_error = number(row, "reference_error");
  const double rms = number(row, "force_error_rms");
  return usable(reference_error) ? std::max(rms, reference_error) : rms;
}

bool ranked(const Json& row) { return row.at("survived").get<bool>() && comparable(row); }

bool fits(const Json& row) {
  const auto absent = [&](std::string_view fault) { return number(row, std::string(fault)) == 0.0; };
  return ranked(row) && !row.at("at_reference_error").get<bool>() && std::ranges::all_of(kLinkFaults, absent) &&
         number(row, "force_error_rms") > 0.0;
}

}  // namespace

std::vector<std::string> setting_columns(const Json& row) {
  std::vector<std::string> columns;
  for (const auto& [column, value] : row.items()) {
    if (column == "force_error_rms") break;
    if (column != "ratio_mean" && (!column.starts_with("user") || column.starts_with("users_")))
      columns.push_back(column);
  }
  return columns;
}

std::vector<std::string> conditions_of(const Json& row) { return without(setting_columns(row), kOfMethod); }

std::vector<const Json*> first_of_each_engine(const std::vector<const Json*>& rows) {
  std::vector<const Json*> firsts;
  for (const Json* row : rows) {
    const auto same = [&](const Json* other) { return other->at("engine") == row->at("engine"); };
    if (std::ranges::none_of(firsts, same)) firsts.push_back(row);
  }
  return firsts;
}

bool comparable(const Json& row) {
  return std::isfinite(number(row, "force_error_rms")) && std::isfinite(number(row, "reference_error"));
}

bool at_bound(double error, double reference_error, double causal_error) {
  constexpr double kNear = 1.1;
  return error <= std::max(usable(reference_error) ? reference_error : 0.0, kNear * causal_error);
}

bool at_causal_bound(const Json& row) { return number(row, "causal_error") > 0.0 && row.at("at_bound").get<bool>(); }

bool imperceptible(const Json& row) {
  return ranked(row) && number(row, "force_error_rms") <= kImperceptibleRms &&
         number(row, "force_error_p99") <= kImperceptibleP99 &&
         std::abs(number(row, "time_offset_s")) <= kImperceptibleOffset_s;
}

bool dominated(const Json& row, const Rows& rows) {
  if (!ranked(row)) return !row.at("survived").get<bool>();
  const std::vector<std::string> conditions = conditions_of(row);
  return std::ranges::any_of(rows, [&](const Json& other) {
    if (!alike(row, other, conditions) || !ranked(other)) return false;
    const double less_error = significant_error(row) - significant_error(other);
    const double less_cpu = total_cpu(row) - total_cpu(other);
    return less_error >= 0.0 && less_cpu >= 0.0 && less_error + less_cpu > 0.0;
  });
}

const Json* choice(const std::vector<const Json*>& rows, double budget) {
  const Json* best = nullptr;
  for (const Json* row : rows) {
    if (!ranked(*row) || total_cpu(*row) > budget) continue;
    const auto rank = [](const Json& of) { return std::pair{significant_error(of), total_cpu(of)}; };
    if (best == nullptr || rank(*row) < rank(*best)) best = row;
  }
  return best;
}

Json convergence(const Rows& rows, const std::string& x) {
  if (rows.empty()) return Json::array();
  const std::vector<std::string> fixed =
      without(without(setting_columns(rows.front()), kLinkFaults), std::array<std::string, 2>{"passivity", x});
  Json fitted = Json::array();
  for (const Json& row : rows) {
    if (std::ranges::any_of(fitted, [&](const Json& done) { return alike(done, row, fixed); })) continue;
    LineFit line;
    for (const Json& other : rows) {
      if (!alike(row, other, fixed) || !fits(other)) continue;
      line.add(std::log(number(other, x)), std::log(number(other, "force_error_rms")));
    }
    Json fit;
    for (const std::string& column : fixed) fit[column] = row.at(column);
    fit["in"] = x;
    fit["points"] = line.count();
    const bool known = line.count() >= 2 && line.spread() > 1e-12;
    fit["order"] = known ? Json(line.slope()) : Json(nullptr);
    fit["factor"] = known ? Json(std::exp(line.offset())) : Json(nullptr);
    fitted.push_back(fit);
  }
  return fitted;
}

Json over_variants(const Rows& rows) {
  Json all = Json::array();
  if (std::ranges::all_of(rows, [](const Json& row) { return row.at("variant") == 0; })) return all;
  const std::vector<std::string> fixed = without(setting_columns(rows.front()), std::array<std::string, 1>{"variant"});
  for (const Json& row : rows) {
    if (std::ranges::any_of(all, [&](const Json& done) { return alike(done, row, fixed); })) continue;
    std::vector<double> errors, floors;
    for (const Json& other : rows) {
      if (!alike(row, other, fixed) || !std::isfinite(number(other, "reference_error"))) continue;
      floors.push_back(number(other, "reference_error"));
      if (ranked(other)) errors.push_back(number(other, "force_error_rms"));
    }
    if (errors.empty()) continue;
    std::ranges::sort(errors);
    Json over;
    for (const std::string& column : fixed) over[column] = row.at(column);
    const std::size_t n = errors.size();
    over["variants"] = floors.size();
    over["survived"] = n;
    over["force_error_rms_median"] = 0.5 * (errors[(n - 1) / 2] + errors[n / 2]);
    over["force_error_rms_max"] = errors.back();
    over["reference_error_min"] = std::ranges::min(floors);
    over["reference_error_max"] = std::ranges::max(floors);
    all.push_back(over);
  }
  return all;
}

}  // namespace subworld
