#include "io/results/json.hpp"
#include "lab/engines/report.hpp"
#include "lab/engines/sweep.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace subworld {

namespace {

/// An engine's colours, in the order of its presets.
struct Look {
  std::array<const char*, 2> colours;
  int mark;
};
constexpr std::array kLooks{Look{{"#0072b2", "#7fc4ee"}, 7}, Look{{"#00704f", "#6fd0ab"}, 5},
                            Look{{"#c04f00", "#f5b07a"}, 9}, Look{{"#99226a", "#e29cc6"}, 13},
                            Look{{"#444444", "#b0b0b0"}, 11}};
constexpr const char* kPaperColour = "#b8860b";
constexpr double kFrame_s = 1.0 / 60.0;
constexpr double kLeastShown_mm = 1e-3;
constexpr double kLeastShown_j = 1e-6;

/// The line of an engine and preset, among the variants of a plot.
Series line_of(const std::string& engine, const std::string& preset, const std::vector<Variant>& variants) {
  std::vector<std::string> engines;
  std::size_t same = 0;
  for (const Variant& v : variants) {
    if (std::ranges::find(engines, v.engine) == engines.end()) engines.push_back(v.engine);
    if (v.engine == engine && v.preset == preset) break;
    if (v.engine == engine) ++same;
  }
  const auto at = static_cast<std::size_t>(std::ranges::find(engines, engine) - engines.begin());
  const Look& look = kLooks[at % kLooks.size()];
  return {.title = engine + " " + preset,
          .colour = look.colours[same % look.colours.size()],
          .width = 2.0,
          .mark = look.mark,
          .dashed = false,
          .points = {}};
}

Plot plot_of(const std::string& title, const std::string& x_label, const std::string& y_label) {
  Plot plot;
  plot.title = title;
  plot.x_label = x_label;
  plot.y_label = y_label;
  plot.log_y = true;
  return plot;
}

/// Mean and maximum step time over the combinations.
Plot step_times(const Rows& rows, const std::vector<Variant>& variants) {
  const std::vector<const Json*> combinations = combinations_of(rows);
  Plot plot = plot_of("Step time: mean (solid) and maximum (dashed)", "friction, restitution, time step in s",
                      "time of a step, ms");
  for (const Json* c : combinations) {
    plot.x_names.push_back(fmt::format("{:g}, {:g}\n{}", number(*c, "friction"), number(*c, "restitution"),
                                       step_text(number(*c, "dt_s"))));
  }
  for (const Variant& variant : variants) {
    Series mean = line_of(variant.engine, variant.preset, variants);
    Series most = mean;
    most.title.clear();
    most.dashed = true;
    most.width = 1.2;
    for (std::size_t i = 0; i < combinations.size(); ++i) {
      for (const Json* row : variant.rows) {
        if (!alike(*row, *combinations[i], {"friction", "restitution", "dt_s"})) continue;
        mean.points.emplace_back(static_cast<double>(i + 1), 1e3 * number(row->at("step_s"), "mean"));
        most.points.emplace_back(static_cast<double>(i + 1), 1e3 * number(row->at("step_s"), "max"));
      }
    }
    plot.series.insert(plot.series.end(), {mean, most});
  }
  return plot;
}

Plot kinetic_energy_plot(const std::vector<const Course*>& courses, const std::vector<Variant>& variants) {
  Plot plot = plot_of(fmt::format("Kinetic energy ({})", combination_text(courses.front()->row)), "time, s",
                      "kinetic energy of all bodies, J");
  for (const Course* course : courses) {
    Series line = line_of(course->row.at("engine"), course->row.at("preset"), variants);
    line.mark = 0;
    line.width = 1.4;
    for (const Json& at : course->history)
      line.points.emplace_back(number(at, "t_s"), std::max(kLeastShown_j, number(at, "kinetic_energy_j")));
    plot.series.push_back(line);
  }
  return plot;
}

Plot error_against_run_time(const Rows& rows, const std::vector<Variant>& variants) {
  const ErrorMeasure error = error_measure(rows.front());
  Plot plot = plot_of(fmt::format("Error against run time (friction {:g}, restitution {:g})",
                                  number(rows.front(), "friction"), number(rows.front(), "restitution")),
                      "CPU ms per frame of 1/60 s", fmt::format("{}, mm", error.words));
  plot.log_x = true;
  Rows finest_last = rows;
  std::ranges::stable_sort(finest_last, std::greater{}, [](const Json& row) { return number(row, "dt_s"); });
  for (const Variant& variant : variants_of(finest_last)) {
    Series line = line_of(variant.engine, variant.preset, variants);
    for (const Json* row : variant.rows) {
      if (row->at("failure") != "") continue;
      line.points.emplace_back(1e3 * cpu_per_frame_s(*row), std::max(kLeastShown_mm, 1e3 * number(*row, error.column)));
    }
    plot.series.push_back(line);
  }
  return plot;
}

/// The paper's line, over the range of bodies of the curves.
Series paper_line(double per_body_ms, const std::vector<CostCurve>& curves) {
  Series line{.title = fmt::format("paper: {:g} ms per body", per_body_ms),
              .colour = kPaperColour,
              .width = 1.5,
              .mark = 0,
              .dashed = true,
              .points = {}};
  for (const Json& row : curves.front().rows)
    line.points.emplace_back(number(row, "bodies"), per_body_ms * number(row, "bodies"));
  return line;
}

Plot cost_plot(const std::vector<CostCurve>& curves, const std::vector<Variant>& variants, const std::string& title,
               const char* x, const char* x_label) {
  Plot plot = plot_of(title, x_label, "mean CPU time of a step, ms");
  plot.log_x = true;
  for (const CostCurve& curve : curves) {
    Series line = line_of(curve.engine, curve.preset, variants);
    for (const Json& row : curve.rows)
      line.points.emplace_back(number(row, x), 1e3 * number(row.at("cpu_step_s"), "mean"));
    plot.series.push_back(line);
  }
  return plot;
}

}  // namespace

std::vector<const Json*> combinations_of(const Rows& rows) {
  std::vector<const Json*> firsts;
  for (const Json& row : rows) {
    const bool known = std::ranges::any_of(firsts, [&](const Json* first) {
      return alike(*first, row, {"friction", "restitution", "dt_s"});
    });
    if (!known) firsts.push_back(&row);
  }
  return firsts;
}

Rows time_steps_of(const Rows& rows) {
  Rows kept;
  std::ranges::copy_if(rows, std::back_inserter(kept), [&](const Json& row) {
    return alike(row, rows.front(), {"friction", "restitution"});
  });
  return kept;
}

ErrorMeasure error_measure(const Json& row) {
  return row.at("kind") == "structure" ? ErrorMeasure{"max_displacement_m", "largest displacement"}
                                       : ErrorMeasure{"penetration_max_m", "deepest penetration"};
}

double cpu_per_frame_s(const Json& row) { return kFrame_s * number(row, "cpu_s_per_simulated_s"); }

std::vector<Plot> plots_of(const Rows& rows, const std::vector<const Course*>& courses) {
  const std::vector<Variant> variants = variants_of(rows);
  std::vector<Plot> plots{step_times(rows, variants)};
  if (!courses.empty()) plots.push_back(kinetic_energy_plot(courses, variants));
  plots.push_back(error_against_run_time(time_steps_of(rows), variants));
  return plots;
}

std::vector<Plot> cost_plots(const Rows& costs) {
  const std::vector<Variant> variants = variants_of(costs);
  std::vector<CostCurve> spaced, dense;
  for (CostCurve& curve : curves_of(costs)) (curve.arrangement == kSpaced ? spaced : dense).push_back(curve);
  std::vector<Plot> plots;
  if (!spaced.empty()) {
    plots.push_back(cost_plot(spaced, variants, "Cubes in the air", "bodies", "bodies"));
    plots.back().series.push_back(paper_line(kPaperSpaced_ms, spaced));
  }
  if (!dense.empty()) {
    plots.push_back(cost_plot(dense, variants, "A dense heap", "bodies", "bodies"));
    plots.back().series.push_back(paper_line(kPaperDense_ms, dense));
    plots.push_back(
        cost_plot(dense, variants, "The same heap against its contacts", "contacts_mean", "contact points, mean"));
  }
  return plots;
}

}  // namespace subworld
