#include "lab/stability/report.hpp"

#include "io/results/json.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/random/report.hpp"
#include "lab/stability/cases/cases.hpp"
#include "lab/stability/map.hpp"
#include "lab/stability/run.hpp"
#include "lab/stability/summary.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace subworld {

namespace {

constexpr const char* kHowToRead =
    R"(<p>Each case sets up a small scene in one engine, measures one quantity, and compares
it with a formula or an independent reference. <b>Error over tolerance</b> is the margin: 1 is the
bound, 0.1 leaves a factor of ten. A tolerance is the least difference that a user would notice; the section of a
case gives the reason. A limit (an angle, a speed, a ratio) is searched: values are increased until one fails, then the
bracket is bisected; &lt; and &ge; mark a limit outside of the range that was tried.</p>
)";

constexpr double kLeastShown = 1e-3;  ///< of the tolerance; smaller errors are drawn here
constexpr double kMostShown = 1e4;

const char* words_of(Compare compare) {
  switch (compare) {
    case Compare::relative:
      return "of the expected value";
    case Compare::absolute:
      return "in the quantity's unit";
    case Compare::at_least:
      return "expected over measured: the limit may not be lower";
    case Compare::at_most:
      return "measured over expected: the limit may not be higher";
  }
  return "";
}

Rows chosen(const Rows& rows, const char* column, const std::string& value) {
  Rows mine;
  std::ranges::copy_if(rows, std::back_inserter(mine), [&](const Json& row) { return row.at(column) == value; });
  return mine;
}

/// Share of the rows of each engine and preset within a multiple of their tolerance.
Plot margins_plot(const Rows& rows, double step_s) {
  constexpr std::array kColours{"#0072b2", "#00704f", "#c04f00", "#99226a", "#444444", "#b8860b"};
  Plot plot;
  plot.title = fmt::format("Rows within a multiple of their tolerance, steps of {} s", step_text(step_s));
  plot.x_label = "error over tolerance";
  plot.y_label = "rows, %";
  plot.log_x = true;
  std::vector<std::string> engines;
  for (const std::string& setting : settings_of(rows)) {
    std::vector<double> margins;
    std::string engine;
    for (const Json& row : rows) {
      if (setting_of(row) != setting || number(row, "step_s") != step_s) continue;
      engine = row.at("engine");
      margins.push_back(std::clamp(margin_of(row), kLeastShown, kMostShown));
    }
    if (margins.empty()) continue;
    if (std::ranges::find(engines, engine) == engines.end()) engines.push_back(engine);
    std::ranges::sort(margins);
    Series series{
        .title = setting,
        .colour = kColours[(engines.size() - 1) % kColours.size()],
        .mark = 0,
        .dashed = std::ranges::any_of(plot.series, [&](const Series& s) { return s.title.starts_with(engine + " "); }),
        .points = {}};
    for (std::size_t i = 0; i < margins.size(); ++i)
      series.points.emplace_back(margins[i], 1e2 * static_cast<double>(i + 1) / static_cast<double>(margins.size()));
    plot.series.push_back(std::move(series));
  }
  plot.series.push_back({.title = "tolerance",
                         .colour = "#888888",
                         .width = 1.5,
                         .mark = 0,
                         .dashed = true,
                         .points = {{1.0, 0.0}, {1.0, 100.0}}});
  return plot;
}

std::vector<Plot> plots_of(const Rows& rows) {
  std::vector<double> steps_s;
  for (const Json& row : rows) {
    if (std::ranges::find(steps_s, number(row, "step_s")) == steps_s.end()) steps_s.push_back(number(row, "step_s"));
  }
  std::vector<Plot> plots;
  for (const double step_s : steps_s) plots.push_back(margins_plot(rows, step_s));
  return plots;
}

std::string passed_table(const Json& summary) {
  TextTable table{.head = {"engine and preset", "rows", "passed", "%"}};
  for (const Json& one : summary.at("settings")) {
    const double rows = number(one, "rows"), passed = number(one, "passed");
    table.rows.push_back({escaped(one.at("setting")), fmt::format("{:g}", rows), fmt::format("{:g}", passed),
                          fmt::format("{:.0f}", 1e2 * passed / rows)});
  }
  return html_of(table);
}

std::string bracket_text(const Json& row) {
  if (row.at("held_at").is_null() && row.at("failed_at").is_null()) return "";
  const auto end = [&](const char* column) {
    return row.at(column).is_null() ? "&ndash;" : fmt::format("{:.4g}", number(row, column));
  };
  return fmt::format("{} / {}", end("held_at"), end("failed_at"));
}

std::string rows_table(const Rows& rows) {
  const bool searched = std::ranges::any_of(rows, [](const Json& row) { return !bracket_text(row).empty(); });
  TextTable table{.head = {"measurement", "engine", "preset", "step s", "measured", "expected", "error", "tolerance",
                           "error / tolerance"},
                  .texts = 3,
                  .remarks = true};
  if (searched) table.head.emplace_back("held / failed at");
  table.head.emplace_back("verdict");
  for (const Json& row : rows) {
    auto& cells = table.rows.emplace_back();
    cells = {escaped(label_of(row)),
             escaped(row.at("engine")),
             escaped(row.at("preset")),
             step_text(number(row, "step_s")),
             escaped(measured_text(row)),
             fmt::format("{:.4g}", number(row, "expected")),
             digits_of(number(row, "error"), 3),
             fmt::format("{:g}", number(row, "tolerance")),
             digits_of(number(row, "error_over_tolerance"), 3)};
    if (searched) cells.push_back(bracket_text(row));
    const std::string failure = row.at("failure");
    cells.push_back(!failure.empty()             ? "failed: " + escaped(failure)
                    : row.at("pass").get<bool>() ? "<span class=good>pass</span>"
                                                 : "miss");
  }
  return html_of(table);
}

void add_case(Page& page, const StabilityCase& one, const Rows& rows) {
  const std::string unit = one.unit.empty() ? "" : ", " + one.unit;
  page.add(fmt::format(
      "<h3 id=\"{0}\">{0}</h3>\n<p>{1}<br>Measured: {2}{3}. Expected: {4}.<br>Source: {5}.<br>Tolerance: {6:g} "
      "({7}), because {8}.</p>\n",
      escaped(one.name), escaped(one.shows), escaped(one.quantity), escaped(unit), escaped(one.formula),
      escaped(one.source), one.tolerance, words_of(one.compare), escaped(one.why)));
  page.add(rows_table(rows));
}

std::string advice_text(const Json& summary) {
  std::string lines;
  for (const Json& line : summary.at("advice"))
    lines += (lines.empty() ? "" : "<br>") + escaped(line.get<std::string>());
  return lines.empty() ? "" : "<p class=choice>" + lines + "</p>\n";
}

}  // namespace

void write_stability_report(const std::string& path, const Rows& rows, const Json& summary) {
  Page page(path, "Stability: the limits of the engines, with margins");
  page.intro(summary.at("about"), summary);
  page.add(advice_text(summary) + (rows.empty() ? "" : kHowToRead));
  if (summary.contains("random")) add_random_section(page, summary.at("random"));
  if (rows.empty()) return page.close();
  page.heading("Map");
  page.add("<div class=wide>" + stability_legend() + "</div>\n");
  std::vector<std::string> groups;
  for (const Json& row : rows) {
    const std::string group = row.at("group");
    if (std::ranges::find(groups, group) == groups.end()) groups.push_back(group);
  }
  for (const std::string& group : groups)
    page.add(fmt::format("<h3>{}</h3><div class=wide>{}</div>\n", escaped(group),
                         stability_map(rows, chosen(rows, "group", group))));
  page.heading("How many rows pass");
  const std::vector<std::string> pictures = svg_of(plots_of(rows));
  page.plots(pictures.data(), pictures.size());
  page.add(passed_table(summary));
  for (const std::string& group : groups) {
    page.heading(group);
    for (const StabilityCase& one : stability_cases()) {
      const Rows mine = chosen(rows, "case", one.name);
      if (one.group == group && !mine.empty()) add_case(page, one, mine);
    }
  }
  page.close();
}

}  // namespace subworld
