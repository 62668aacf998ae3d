#include "lab/plan/report.hpp"

#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "model/settings/optimisation.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace subworld {

namespace {

constexpr const char* kHowToRead =
    R"(<p>Each scene is run twice in lock-step in one process: with an optimisation on, which
is the default, and off (<code>--disable ITEM</code>). A <b>ratio</b> is the cost with the optimisation on over the cost
with it off: 0.1 means that a tenth of the cost remains, 1 that nothing is saved. The runs alternate, and the least CPU
time of each kind counts. World and haptic are the CPU times of all their steps, without the time of reading the clock.
Bytes are those of a frame and a report, memory is allocated at the end, and start is the CPU time until the first
step. <b>Same</b>: all states of the world and all forces on operators are equal bit by bit. <b>Same force</b>: the forces
are equal bit by bit. Otherwise the table gives the difference of the felt force (RMS) and the scene's reference error:
the difference between the reference at step h and at h / 4. Differences below the reference error are not significant.
Above it the table gives the errors of both runs. The places of the bodies at the end are compared likewise. <b>Worse</b>
means that the optimisation raises one of these errors by more than the reference error.</p>
)";

constexpr std::array kColumns{Column{"world CPU", "world_cpu_ratio", 1.0, 3},
                              Column{"haptic CPU", "haptic_cpu_ratio", 1.0, 3}, Column{"bytes", "bytes_ratio", 1.0, 3},
                              Column{"memory", "memory_ratio", 1.0, 3}, Column{"start", "start_ratio", 1.0, 3}};

bool is_enabled(const Json& row) { return row.at("enabled").get<bool>(); }
bool hash_equal(const Json& row) { return row.at("hash_equal").get<bool>(); }
bool held(const Json& row) { return row.at("held").get<bool>(); }

std::string position_text(const Json& row) {
  const double apart_m = number(row, "position_difference_max_m");
  const double reference_m = number(row, "reference_position_error_m");
  if (!(apart_m > reference_m)) return "";
  return fmt::format("; bodies {:.2g} mm apart at the end, reference {:.2g} mm", 1e3 * apart_m, 1e3 * reference_m);
}

std::string force_text(const Json& row) {
  if (!is_enabled(row)) return "&ndash;";
  if (hash_equal(row)) return "<span class=good>same</span>";
  const double difference = number(row, "force_difference_rms");
  if (!std::isfinite(difference)) return "no force felt";
  if (difference == 0.0) return "<span class=good>same force</span>";
  const double reference_error = number(row, "reference_error");
  const std::string text = fmt::format("{:.2g} % of {:.2g} %", 1e2 * difference, 1e2 * reference_error);
  if (difference <= reference_error) return text;
  return fmt::format("{}: error {:.2g} % on, {:.2g} % off", text, 1e2 * number(row, "error_enabled_rms"),
                     1e2 * number(row, "error_disabled_rms"));
}

std::string difference_text(const Json& row) {
  return force_text(row) + position_text(row) + (held(row) ? "" : " <b>worse</b>");
}

std::string table_of(const Rows& rows, const std::string& item) {
  TextTable table{.head = {"scene"}, .texts = 1, .remarks = true};
  for (const Column& column : kColumns) table.head.emplace_back(column.title);
  table.head.insert(table.head.end(), {"difference, of the reference error", "because"});
  for (const Json& row : rows) {
    if (row.at("item") != item) continue;
    auto& cells = table.rows.emplace_back();
    cells.push_back(escaped(row.at("scene")));
    for (const Column& column : kColumns) cells.push_back(cell_of(column, row));
    cells.push_back(difference_text(row));
    cells.push_back(escaped(row.at("reason")));
  }
  return html_of(table);
}

/// Geometric mean of a ratio over the rows of an item; not a number without rows.
double mean_ratio(const Rows& rows, const std::string& item, const char* key) {
  double sum = 0.0;
  int count = 0;
  for (const Json& row : rows) {
    const double ratio = row.at("item") == item ? number(row, key) : NAN;
    if (!(ratio > 0.0) || !std::isfinite(ratio)) continue;
    sum += std::log(ratio);
    ++count;
  }
  return count == 0 ? NAN : std::exp(sum / count);
}

std::vector<std::string> items_of(const Rows& rows) {
  std::vector<std::string> items;
  for (const Json& row : rows) {
    const std::string item = row.at("item");
    if (std::ranges::find(items, item) == items.end()) items.push_back(item);
  }
  return items;
}

std::string what(const std::string& item) {
  const auto found = std::ranges::find(optimisation_items(), std::string_view(item), &OptimisationItem::name);
  return found == optimisation_items().end() ? "all work that the plan skips"
                                             : fmt::format("{} ({})", found->what, found->where);
}

Plot plot_of(const Rows& rows, const std::string& item) {
  Plot plot;
  plot.title = fmt::format("{}: remaining cost, scenes in order of the world's", item);
  plot.x_label = "scene";
  plot.y_label = "cost on over off";
  constexpr std::array kColours{"#0072b2", "#c04f00", "#00704f"};
  std::vector<const Json*> mine;
  for (const Json& row : rows) {
    if (row.at("item") == item && is_enabled(row)) mine.push_back(&row);
  }
  std::ranges::sort(mine, {}, [](const Json* row) { return number(*row, "world_cpu_ratio"); });
  for (std::size_t k = 0; k < kColours.size(); ++k) {
    Series series{.title = kColumns[k].title, .colour = kColours[k], .points = {}};
    for (std::size_t i = 0; i < mine.size(); ++i)
      series.points.emplace_back(static_cast<double>(i + 1), number(*mine[i], kColumns[k].key));
    plot.series.push_back(std::move(series));
  }
  return plot;
}

}  // namespace

Json plan_summary(const Rows& rows, std::size_t planned) {
  Json summary = begin_summary("plan", rows.size(), planned);
  summary["items"] = Json::array();
  for (const std::string& item : items_of(rows)) {
    const auto count = [&](const auto& holds) {
      return std::ranges::count_if(rows, [&](const Json& row) { return row.at("item") == item && holds(row); });
    };
    Json one = {{"item", item},
                {"what", what(item)},
                {"enabled", count(is_enabled)},
                {"hash_equal", count([](const Json& row) { return is_enabled(row) && hash_equal(row); })},
                {"worse", count([](const Json& row) { return !held(row); })}};
    for (const Column& column : kColumns) one[column.key] = mean_ratio(rows, item, column.key);
    summary["items"].push_back(std::move(one));
  }
  const auto out = std::ranges::count_if(rows, is_enabled);
  const auto same = std::ranges::count_if(rows, [](const Json& row) { return is_enabled(row) && hash_equal(row); });
  const auto above = std::ranges::count_if(rows, [](const Json& row) { return !held(row); });
  summary["verdict"] = fmt::format(
      "{} comparisons of scenes with an optimisation on: {} equal bit by bit, {} below the reference error or "
      "no farther from the reference, {} worse{}",
      out, same, out - same - above, above, stopped_text(rows.size(), planned));
  return summary;
}

void write_plan_report(const std::string& path, const Rows& rows, const Json& summary) {
  Page page(path, "The plan: savings and differences of the optimisations");
  page.intro("Every item of the plan, on and off.", summary);
  page.add(kHowToRead);
  page.heading("Items");
  TextTable items{.head = {"item", "on in", "same", "worse"}, .texts = 1, .remarks = true};
  for (const Column& column : kColumns) items.head.emplace_back(column.title);
  items.head.emplace_back("skips");
  for (const Json& one : summary.at("items")) {
    auto& cells = items.rows.emplace_back();
    cells = {escaped(one.at("item")), fmt::format("{} scenes", one.at("enabled").get<int>()),
             fmt::format("{}", one.at("hash_equal").get<int>()), fmt::format("{}", one.at("worse").get<int>())};
    for (const Column& column : kColumns) cells.push_back(cell_of(column, one));
    cells.push_back(escaped(one.at("what")));
  }
  page.add(html_of(items));
  page.add("<p>Ratios are geometric means over the scenes.</p>\n");
  for (const std::string& item : items_of(rows)) {
    page.heading(item);
    page.add(fmt::format("<p>Skips: {}.</p>\n", escaped(what(item))));
    if (std::ranges::count_if(rows, [&](const Json& row) { return row.at("item") == item && is_enabled(row); }) > 1) {
      const std::vector<std::string> pictures = svg_of({plot_of(rows, item)});
      page.plots(pictures.data(), pictures.size());
    }
    page.add(table_of(rows, item));
  }
  page.close();
}

}  // namespace subworld
