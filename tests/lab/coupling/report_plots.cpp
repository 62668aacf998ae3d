#include "io/results/json.hpp"
#include "lab/coupling/report.hpp"
#include "model/slips.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace subworld {

namespace {

/// Columns with other words than their name.
const std::array kNamed{
    AxisText{"haptic_engine", "haptic", "", ""},
    AxisText{"h_s", "h", "the haptic step", "haptic step h"},
    AxisText{"ratio", "r", "the ratio", "simulation ratio r = T / h"},
    AxisText{"ratio_most", "r at most", "the largest ratio", "largest simulation ratio"},
    AxisText{"box_m", "box", "the box", "half side of the box"},
    AxisText{"contact_depth", "depth", "the depth of contact", "contacts from the proxy to a member"},
    AxisText{"budget_ratio", "budget", "the budget", "budget of a haptic step, part of h"},
    AxisText{"world_substeps", "sub-steps", "sub-steps", "world sub-steps per cycle"},
    AxisText{"latency_s", "latency", "latency", "latency added to the round trip"},
    AxisText{"jitter_s", "jitter", "jitter", "jitter"},
    AxisText{"device_latency_s", "device latency", "latency of the device",
             "latency added between device and sub-world"},
    AxisText{"loss_ratio", "loss", "lost messages", "lost messages"},
    AxisText{"coupling_stiffness_n_m", "K", "coupling stiffness", "coupling stiffness"}};

struct Look {
  const char* scheme;
  const char* colour;
};
constexpr std::array kLooks{Look{"direct", "#777777"}, Look{"paper_literal", "#d55e00"}, Look{"paper", "#0072b2"},
                            Look{"reduced", "#009e73"}};
constexpr const char* kReferenceErrorColour = "#aa3377";
constexpr const char* kThresholdColour = "#b8860b";
constexpr std::array kMarks{7, 5, 9, 13, 11, 6, 4, 8, 12, 10};
constexpr double kLeastShown_percent = 0.01;
constexpr std::size_t kMostTracePoints = 1500;

std::string colour_of(const std::string& scheme) {
  for (const Look& look : kLooks) {
    if (scheme == look.scheme) return look.colour;
  }
  return "#000000";
}

/// The reference has the engine of the world, so each engine has its own reference error.
std::vector<Level> levels_of(const std::vector<const Json*>& rows) {
  std::vector<Level> levels;
  const std::vector<const Json*> engines = first_of_each_engine(rows);
  for (const Json* row : engines) {
    const std::string of = engines.size() > 1 ? " of " + row->at("engine").get<std::string>() : "";
    const double error = 100.0 * number(*row, "reference_error");
    levels.push_back({fmt::format("reference error{} {:.2g} %", of, error), kReferenceErrorColour, error});
  }
  levels.push_back(
      {fmt::format("imperceptible {:g} %", 100.0 * kImperceptibleRms), kThresholdColour, 100.0 * kImperceptibleRms});
  return levels;
}

/// A line for each set of rows that differ only in `x`.
std::vector<Series> lines_of(const std::vector<const Json*>& rows, const std::vector<std::string>& columns,
                             const std::string& x, const auto& point_of) {
  std::vector<std::string> others = columns;
  std::erase(others, x);
  const std::vector<std::string> named = swept(rows);
  std::vector<Series> lines;
  std::vector<const Json*> firsts;
  for (const Json* row : rows) {
    std::size_t line = 0;
    while (line < firsts.size() && !alike(*firsts[line], *row, others)) ++line;
    if (line == firsts.size()) {
      firsts.push_back(row);
      const std::string scheme = row->at("scheme");
      const auto same =
          static_cast<std::size_t>(std::ranges::count_if(firsts, [&](auto* f) { return f->at("scheme") == scheme; }));
      const std::string text = swept_text(*row, named, x);
      lines.push_back({.title = text.empty() ? scheme : text,
                       .colour = colour_of(scheme),
                       .width = 2.0,
                       .mark = kMarks[(same - 1) % kMarks.size()],
                       .dashed = same > 1,
                       .points = {}});
    }
    if (row->at("survived").get<bool>()) lines[line].points.push_back(point_of(*row));
  }
  return lines;
}

double error_percent(const Json& row) {
  return std::max(kLeastShown_percent, 100.0 * row.at("force_error_rms").get<double>());
}

/// The first row of the shown ratio, and the rows that equal it in each swept column but the free ones.
std::vector<const Json*> slice(const Rows& rows, std::vector<std::string> columns, const std::set<std::string>& free) {
  std::vector<int> ratios;
  for (const Json& row : rows) ratios.push_back(row.at("ratio"));
  const Json& model =
      *std::ranges::find(rows, shown_ratio(ratios), [](const Json& r) { return r.at("ratio").get<int>(); });
  std::erase_if(columns, [&](const std::string& c) { return free.contains(c); });
  std::vector<const Json*> kept;
  for (const Json& row : rows) {
    if (alike(row, model, columns)) kept.push_back(&row);
  }
  return kept;
}

std::set<std::string> kinds() { return {"scheme", "engine", "haptic_engine", "passivity"}; }

/// "Error against X", with the values of the swept columns that are common to all rows.
std::string title_of(const std::string& against, const std::vector<const Json*>& rows,
                     std::vector<std::string> columns) {
  const std::vector<std::string> varying = swept(rows);
  std::erase_if(columns, [&](const std::string& c) { return std::ranges::find(varying, c) != varying.end(); });
  const std::string common = swept_text(*rows.front(), columns, "");
  return fmt::format("Error against {}{}", against, common.empty() ? "" : fmt::format(" ({})", common));
}

Plot work_precision(const Rows& rows, const std::vector<std::string>& columns) {
  std::set<std::string> free = kinds();
  free.insert({"ratio", "ratio_most", "box_m", "contact_depth", "budget_ratio", "world_substeps"});
  const auto chosen = slice(rows, columns, free);
  return {.title = title_of("run time", chosen, columns),
          .x_label = "CPU s per simulated s",
          .y_label = "felt-force error, RMS, %",
          .log_x = true,
          .log_y = true,
          .x_ticks = {},
          .series = lines_of(chosen, columns, "ratio",
                             [](const Json& row) {
                               return std::pair{total_cpu(row), error_percent(row)};
                             }),
          .levels = levels_of(chosen)};
}

Plot error_against(const std::string& x, const Rows& rows, const std::vector<std::string>& columns) {
  std::set<std::string> free = kinds();
  free.insert(x);
  const AxisText axis = axis_text(x);
  const auto chosen = slice(rows, columns, free);
  std::set<double> values;
  for (const Json* row : chosen) values.insert(axis.scale * row->at(x).get<double>());
  const bool log_x = *values.begin() > 0.0;
  return {.title = title_of(axis.words, chosen, columns),
          .x_label = axis.label + (axis.unit.empty() ? "" : "," + axis.unit),
          .y_label = "felt-force error, RMS, %",
          .log_x = log_x,
          .log_y = true,
          .x_ticks = {values.begin(), values.end()},
          .series = lines_of(chosen, columns, x,
                             [&](const Json& row) {
                               return std::pair{axis.scale * row.at(x).get<double>(), error_percent(row)};
                             }),
          .levels = levels_of(chosen)};
}

/// The component of the reference with the largest RMS.
int strongest(const std::vector<Vec3>& reference) {
  Vec3 sums = Vec3::Zero();
  for (const Vec3& f : reference) sums += f.cwiseAbs2();
  int axis = 0;
  sums.maxCoeff(&axis);
  return axis;
}

Series trace_line(const std::string& title, const std::vector<Vec3>& force, double h_s, int axis, double limit) {
  Series line{.title = title, .colour = colour_of(title), .width = 1.4, .mark = 0, .dashed = false, .points = {}};
  const std::size_t stride = std::max<std::size_t>(1, force.size() / kMostTracePoints);
  for (std::size_t i = 0; i < force.size(); i += stride)
    line.points.emplace_back(static_cast<double>(i) * h_s, std::clamp(force[i][axis], -limit, limit));
  return line;
}

Plot felt_force(const std::vector<const Trace*>& traces) {
  const Trace& first = *traces.front();
  const int axis = strongest(first.reference);
  double largest = 0.0;
  for (const Vec3& f : first.reference) largest = std::max(largest, std::abs(f[axis]));
  const double limit = 2.5 * largest;
  const std::string late = first.latency_s > 0.0 ? fmt::format(", {:g} ms late", 1e3 * first.latency_s) : "";
  Plot plot{.title = fmt::format("Felt force of user {} at ratio {}{}", first.user, first.ratio, late),
            .x_label = "time, s",
            .y_label = fmt::format("force {}, N", "xyz"[axis]),
            .x_ticks = {},
            .series = {trace_line("reference", first.reference, first.h_s, axis, limit)},
            .levels = {}};
  plot.series.front().width = 4.0;
  plot.series.front().colour = "#bbbbbb";
  for (const Trace* trace : traces)
    plot.series.push_back(trace_line(trace->scheme, trace->force, trace->h_s, axis, limit));
  return plot;
}

/// Empty if no ratio changes.
std::optional<Plot> ratios(const std::vector<const Trace*>& traces) {
  Plot plot{.title = "Simulation ratio while it adapts",
            .x_label = "time, s",
            .y_label = "haptic steps a cycle",
            .x_ticks = {},
            .series = {},
            .levels = {}};
  for (const Trace* trace : traces) {
    if (std::ranges::adjacent_find(trace->ratios, std::ranges::not_equal_to{}) == trace->ratios.end()) continue;
    Series line{.title = trace->scheme,
                .colour = colour_of(trace->scheme),
                .width = 1.4,
                .mark = 0,
                .dashed = false,
                .points = {}};
    for (std::size_t i = 0; i < trace->ratios.size(); ++i) {
      const bool corner = i == 0 || i + 1 == trace->ratios.size() || trace->ratios[i - 1] != trace->ratios[i];
      if (!corner) continue;
      if (i > 0) line.points.emplace_back(static_cast<double>(i) * trace->h_s, trace->ratios[i - 1]);
      line.points.emplace_back(static_cast<double>(i) * trace->h_s, trace->ratios[i]);
    }
    plot.series.push_back(std::move(line));
  }
  if (plot.series.empty()) return std::nullopt;
  return plot;
}

}  // namespace

AxisText axis_text(const std::string& column) {
  const auto named = std::ranges::find(kNamed, column, &AxisText::column);
  AxisText text = named != kNamed.end() ? *named : AxisText{column, column, column, column};
  const std::string_view unit = unit_of(column);
  text.scale = unit == "s" ? 1e3 : unit == kPartUnit ? 1e2 : 1.0;
  text.unit = unit == "s" ? " ms" : unit == kPartUnit ? " %" : unit.empty() ? "" : fmt::format(" {}", unit);
  return text;
}

std::vector<std::string> swept(const std::vector<const Json*>& rows) {
  std::vector<std::string> columns;
  for (const std::string& column : setting_columns(*rows.front())) {
    const auto same = [&](const Json* row) { return row->at(column) == rows.front()->at(column); };
    if (column != "scene" && !std::ranges::all_of(rows, same)) columns.push_back(column);
  }
  return columns;
}

std::vector<std::string> swept(const Rows& rows) {
  std::vector<const Json*> all;
  for (const Json& row : rows) all.push_back(&row);
  return swept(all);
}

std::string swept_text(const Json& row, const std::vector<std::string>& columns, const std::string& x) {
  std::string text;
  for (const std::string& column : columns) {
    if (column == x) continue;
    const AxisText axis = axis_text(column);
    const Json& value = row.at(column);
    const std::string shown = value.is_number()   ? fmt::format("{:g}{}", axis.scale * value.get<double>(), axis.unit)
                              : value.is_string() ? value.get<std::string>()
                                                  : value.dump();
    const bool bare = column == "scheme" || column == "engine";
    text += fmt::format("{}{}{}", text.empty() ? "" : ", ", bare ? "" : axis.name + " ", shown);
  }
  return text;
}

std::vector<Plot> plots_of(const Rows& rows, const std::vector<Trace>& traces) {
  const std::vector<std::string> columns = swept(rows);
  std::vector<Plot> plots{work_precision(rows, columns)};
  for (const std::string& x : columns) {
    if (x != "variant" && rows.front().at(x).is_number()) plots.push_back(error_against(x, rows, columns));
  }
  std::map<std::pair<double, std::size_t>, std::vector<const Trace*>> by_latency_and_user;
  for (const Trace& trace : traces) {
    if (rows.front().at("scene") == trace.scene) by_latency_and_user[{trace.latency_s, trace.user}].push_back(&trace);
  }
  for (const auto& [key, alike] : by_latency_and_user) {
    plots.push_back(felt_force(alike));
    if (auto adapted = key.second == 0 ? ratios(alike) : std::nullopt) plots.push_back(std::move(*adapted));
  }
  return plots;
}

}  // namespace subworld
