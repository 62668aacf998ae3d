#include "lab/stability/run.hpp"

#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/page/tables.hpp"
#include "lab/stability/bed.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr const char* kCompareNames[] = {"relative", "absolute", "at least", "at most"};

constexpr double kTiny = 1e-3, kHuge = 1e5;  ///< measured values outside are written with few digits and an exponent

/// Steps in a simulated second.
double work_of(const StabilityPoint& point) { return point.one->own_step ? 1.0 : 1.0 / point.setting.dt_s; }

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json facts_of(const StabilityPoint& point) {
  const StabilityCase& one = *point.one;
  return {{"case", one.name},
          {"group", one.group},
          {"engine", point.setting.engine},
          {"preset", point.setting.preset},
          {"step_s", point.setting.dt_s},
          {"parameter", one.parameter.empty() ? one.quantity : one.parameter},
          {"parameter_unit", one.parameter.empty() ? one.unit : one.parameter_unit},
          {"value", point.value ? Json(*point.value) : Json(nullptr)},
          {"quantity", one.quantity},
          {"unit", one.unit},
          {"compare", kCompareNames[static_cast<std::size_t>(one.compare)]}};
}

/// Relation of the limit to the number if the search did not enclose it.
const char* bound_of(const Bracket& bracket) {
  if (bracket.inside()) return "";
  if (std::isfinite(bracket.held)) return bracket.upwards ? ">=" : "<=";
  return bracket.upwards ? "<" : ">";
}

}  // namespace

double error_of(Compare compare, double measured, double expected) {
  switch (compare) {
    case Compare::relative:
      return std::abs(measured - expected) / std::abs(expected);
    case Compare::absolute:
      return std::abs(measured - expected);
    case Compare::at_least:
      return expected / measured;
    case Compare::at_most:
      return measured / expected;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

std::optional<Json> measured_row(const StabilityPoint& point) {
  const StabilityCase& one = *point.one;
  const double value = point.value.value_or(std::numeric_limits<double>::quiet_NaN());
  Json row = facts_of(point);
  Measurement found{.measured = std::numeric_limits<double>::quiet_NaN()};
  std::string failure;
  try {
    found = one.measure(point.setting, value);
    if (!std::isfinite(found.measured)) failure = "not a number";
  } catch (const Interrupted&) {
    return std::nullopt;
  } catch (const std::exception& wrong) {
    failure = wrong.what();
  }
  const double expected = one.expected(value), error = error_of(one.compare, found.measured, expected);
  if (one.parameter.empty() && found.bracket) row["value"] = number_or_null(found.measured);
  row["measured"] = number_or_null(found.measured);
  row["expected"] = expected;
  row["error"] = number_or_null(error);
  row["tolerance"] = one.tolerance;
  row["error_over_tolerance"] = number_or_null(error / one.tolerance);
  row["pass"] = error <= one.tolerance;
  row["held_at"] = found.bracket ? number_or_null(found.bracket->held) : Json(nullptr);
  row["failed_at"] = found.bracket ? number_or_null(found.bracket->failed) : Json(nullptr);
  row["bound"] = found.bracket ? bound_of(*found.bracket) : "";
  row["failure"] = failure;
  row["source"] = one.source;
  return row;
}

double margin_of(const Json& row) {
  const double margin = number(row, "error_over_tolerance");
  return std::isfinite(margin) ? margin : std::numeric_limits<double>::infinity();
}

std::string measured_text(const Json& row) {
  if (row.at("measured").is_null()) return "failed";
  const double measured = number(row, "measured"), size = std::abs(measured);
  return row.at("bound").get<std::string>() + (size > 0.0 && size < kTiny ? fmt::format("{:.0e}", measured)
                                               : size >= kHuge            ? fmt::format("{:.3g}", measured)
                                                                          : digits_of(measured, 3));
}

double StabilityProgress::left_s() const {
  double sum_s = 0.0;
  for (std::size_t i = done_; i < points_.size(); ++i) {
    auto rate = rates_.find(points_[i].label());
    if (rate == rates_.end()) rate = rates_.find("");
    sum_s += rate->second.seconds / rate->second.work * work_of(points_[i]);
  }
  return sum_s;
}

void StabilityProgress::after(const Json& row) {
  const StabilityPoint& point = points_[done_++];
  const double passed_s = std::chrono::duration<double>(Clock::now() - began_).count();
  for (const std::string& key : {point.label(), std::string()}) {
    rates_[key].work += work_of(point);
    rates_[key].seconds += passed_s;
  }
  const std::string failure = row.at("failure");
  const std::string verdict = !failure.empty()             ? "failed: " + failure
                              : row.at("pass").get<bool>() ? "pass"
                                                           : fmt::format("MISSED by {:.3g}", margin_of(row));
  fmt::print("[{:4}/{}] {:<28} {:<20} {:<7} {} {} {} (expected {:.4g})  {}{}\n", done_, points_.size(), point.label(),
             point.setting.name(), step_text(point.setting.dt_s), point.one->quantity, measured_text(row),
             point.one->unit, number(row, "expected"), verdict, left_text(left_s()));
  std::fflush(stdout);
  began_ = Clock::now();
}

}  // namespace subworld
