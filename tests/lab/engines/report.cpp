#include "lab/engines/report.hpp"

#include "io/results/json.hpp"
#include "lab/engines/sweep.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr const char* kHowToRead = R"(<p>Each run is one engine alone: the scene without its users, one
<b>step()</b> after the other for the simulated time, and only that call is timed, on a clock of microseconds (wall time)
and on the CPU clock of the thread. Friction and restitution are those of each pair, the same for all bodies. Low and to
the left is best in &ldquo;error against run time&rdquo;: a small error for little CPU time. Bodies of a structure should
not move, so their displacement is the error. In a falling scene the error is the penetration. Values under
0.001 mm and 0.000001 J are drawn there.</p>
)";

constexpr Column kColumns[] = {{"friction", "friction", 1, 3},
                               {"restitution", "restitution", 1, 3},
                               {"step mean ms", "step_s", 1e3, 3, "mean"},
                               {"p50 ms", "step_s", 1e3, 3, "p50"},
                               {"p99 ms", "step_s", 1e3, 3, "p99"},
                               {"p99.9 ms", "step_s", 1e3, 3, "p99_9"},
                               {"max ms", "step_s", 1e3, 3, "max"},
                               {"CPU max ms", "cpu_step_s", 1e3, 3, "max"},
                               {"CPU s per simulated s", "cpu_s_per_simulated_s", 1, 3},
                               {"fell at s", "fell_at_s", 1, 3},
                               {"displacement max mm", "max_displacement_m", 1e3, 3},
                               {"of the top body mm", "top_displacement_m", 1e3, 3},
                               {"penetration max mm", "penetration_max_m", 1e3, 3},
                               {"of the smallest dimension %", "penetration_ratio", 1e2, 3},
                               {"kinetic energy at the end J", "kinetic_energy_j", 1, 3},
                               {"at most J", "kinetic_energy_max_j", 1, 3},
                               {"contacts mean", "contacts_mean", 1, 4}};

std::string paragraph(const char* kind, const std::string& text) {
  return fmt::format("<p class={}>{}</p>\n", kind, text);
}

std::string verdict_of(const Json& row) {
  const std::string failure = row.at("failure");
  if (!failure.empty()) return "failed: " + escaped(failure);
  std::string text = row.at("held").get<bool>() ? "<span class=good>held</span>" : "lost";
  return text + (row.at("at_rest").get<bool>() ? ", at rest" : ", moving");
}

std::string runs_table(const Rows& rows) {
  TextTable table{.head = {"engine", "preset", "time step s"}, .texts = 2, .remarks = true};
  for (const Column& column : kColumns) table.head.emplace_back(column.title);
  table.head.emplace_back("verdict");
  for (const Json& row : rows) {
    auto& cells = table.rows.emplace_back();
    cells = {escaped(row.at("engine")), escaped(row.at("preset")), step_text(number(row, "dt_s"))};
    for (const Column& column : kColumns) cells.push_back(cell_of(column, row));
    cells.push_back(verdict_of(row));
  }
  return html_of(table);
}

std::string stood_text(double value) {
  return std::isnan(value) ? "&ndash;" : std::isinf(value) ? "to the end" : fmt::format("{:.2g} s", value);
}

/// The paper's Table 2: a column for each engine and preset of this lab and each engine of the paper.
std::string grades_matrix(const Rows& rows) {
  TextTable table{.head = {"scene"}};
  const std::vector<Variant> variants = variants_of(rows);
  for (const Variant& variant : variants) table.head.push_back(escaped(variant.name()));
  std::vector<std::string> of_paper;
  for (const PaperGrade& paper : paper_grades()) {
    if (std::ranges::find(of_paper, paper.engine) == of_paper.end()) of_paper.emplace_back(paper.engine);
  }
  for (const std::string& engine : of_paper) table.head.push_back(fmt::format("<i>{}, paper</i>", engine));
  for (const Rows& scene : by_scene(rows)) {
    if (scene.front().at("kind") != "structure") continue;
    auto& cells = table.rows.emplace_back(std::vector<std::string>{escaped(scene.front().at("scene"))});
    const std::vector<Variant> here = variants_of(scene);
    for (const Variant& variant : variants) {
      const auto at = std::ranges::find(here, variant.name(), &Variant::name);
      cells.push_back(at == here.end() ? "&ndash;" : fmt::format("<b>{}</b>", grade(*at)));
    }
    for (const std::string& engine : of_paper) {
      const std::vector<PaperGrade> known = paper_grades();
      const auto at = std::ranges::find_if(known, [&](const PaperGrade& paper) {
        return scene.front().at("scene") == paper.scene && engine == paper.engine;
      });
      cells.push_back(at == known.end() ? "&ndash;" : fmt::format("<i>{}</i>", at->grade));
    }
  }
  if (table.rows.empty()) return "";
  return html_of(table) +
         paragraph("facts", escaped(kGradesInWords) + fmt::format(" Here after {:g} s, in the paper after "
                                                                  "10 s.",
                                                                  number(rows.front(), "duration_s")));
}

/// The measurements behind the grades, and the paper's results.
std::string behind_grades(const Rows& rows) {
  TextTable table{.head = {"scene", "engine", "preset", "stood with friction", "without friction", "mean step ms",
                           "max ms", "remarks"},
                  .texts = 3,
                  .remarks = true};
  for (const Rows& scene : by_scene(rows)) {
    const std::string name = scene.front().at("scene");
    const bool structure = scene.front().at("kind") == "structure";
    for (const Variant& variant : variants_of(scene)) {
      double mean_s = 0.0, most_s = 0.0;
      for (const Json* row : variant.rows) {
        mean_s += number(row->at("step_s"), "mean") / static_cast<double>(variant.rows.size());
        most_s = std::max(most_s, number(row->at("step_s"), "max"));
      }
      const auto stood = [&](const auto& of) { return structure ? stood_text(longest_stand_s(of)) : "&ndash;"; };
      const auto held =
          std::ranges::count_if(variant.rows, [](const Json* row) { return row->at("held").get<bool>(); });
      table.rows.push_back({escaped(name), escaped(variant.engine), escaped(variant.preset),
                            stood(with_friction(variant)), stood(without_friction(variant)), digits_of(1e3 * mean_s, 3),
                            digits_of(1e3 * most_s, 3), fmt::format("{} of {} runs held", held, variant.rows.size())});
    }
    for (const PaperGrade& paper : paper_grades()) {
      if (name != paper.scene) continue;
      table.rows.push_back({paper.scene, fmt::format("<i>{}</i>", paper.engine), "<i>paper</i>", "", "", "", "",
                            fmt::format("<i>{}</i>", paper.prose)});
    }
  }
  return html_of(table) +
         paragraph("facts",
                   "<i>Slanted: from the paper (Table 2 and section 3.3), on a Pentium D of 3.4 GHz, ten "
                   "simulated seconds.</i> &ldquo;Stood&rdquo; is the longest of the runs; times are over all "
                   "runs. Where a step's longest wall time is far above its longest CPU time, another program "
                   "had the processor.");
}

/// The first history row at or after each whole second.
std::string kinetic_table(const std::vector<const Course*>& courses) {
  if (courses.empty()) return "";
  TextTable table{.head = {"time s"}};
  for (const Course* course : courses)
    table.head.push_back(
        escaped(course->row.at("engine").get<std::string>() + " " + course->row.at("preset").get<std::string>()));
  const double duration_s = number(courses.front()->row, "duration_s");
  const double every_s = duration_s / 10.0;
  for (int i = 1; i <= 10; ++i) {
    auto& cells = table.rows.emplace_back(std::vector{fmt::format("{:g}", i * every_s)});
    for (const Course* course : courses) {
      const auto at = std::ranges::find_if(course->history,
                                           [&](const Json& row) { return number(row, "t_s") >= i * every_s - 1e-9; });
      cells.push_back(at == course->history.end() ? "&ndash;" : fmt::format("{:.3g}", number(*at, "kinetic_energy_j")));
    }
  }
  return paragraph("facts", fmt::format("Kinetic energy in J ({}):", combination_text(courses.front()->row))) +
         html_of(table);
}

std::string error_table(const Rows& rows) {
  const ErrorMeasure error = error_measure(rows.front());
  TextTable table{
      .head = {"engine", "preset", "time step s", "CPU ms per frame of 1/60 s", fmt::format("{} mm", error.words)},
      .texts = 2};
  for (const Variant& variant : variants_of(rows)) {
    for (const Json* row : variant.rows) {
      table.rows.push_back({escaped(variant.engine), escaped(variant.preset), step_text(number(*row, "dt_s")),
                            digits_of(1e3 * cpu_per_frame_s(*row), 3), digits_of(1e3 * number(*row, error.column), 3)});
    }
  }
  return paragraph("facts", "Error against run time:") + html_of(table);
}

std::string cost_rows_table(const Rows& costs) {
  TextTable table{.head = {"arrangement", "engine", "preset", "bodies", "contacts", "CPU mean ms", "step mean ms",
                           "p99 ms", "max ms"},
                  .texts = 3};
  const auto ms = [](const Json& times, const char* key) { return fmt::format("{:.3g}", 1e3 * number(times, key)); };
  for (const Json& row : costs) {
    const Json& step = row.at("step_s");
    table.rows.push_back({row.at("arrangement"), escaped(row.at("engine")), escaped(row.at("preset")),
                          fmt::format("{:g}", number(row, "bodies")),
                          fmt::format("{:.4g}", number(row, "contacts_mean")), ms(row.at("cpu_step_s"), "mean"),
                          ms(step, "mean"), ms(step, "p99"), ms(step, "max")});
  }
  return paragraph("facts", "Measurements:") + html_of(table);
}

std::string fits_table(const std::vector<CostCurve>& curves) {
  TextTable table{.head = {"arrangement", "engine", "preset", "ms per body", "R&sup2;", "ms per contact", "R&sup2;"},
                  .texts = 3};
  const auto slope = [](const LineFit& fit) {
    return fmt::format("{:.3g} &plusmn; {:.1g}", 1e3 * fit.slope(), 1e3 * fit.standard_error());
  };
  for (const CostCurve& curve : curves) {
    const LineFit bodies = per_body(curve), contacts = per_contact(curve);
    const bool touching = curve.arrangement == kDense && contacts.spread() > 0.0;
    table.rows.push_back({curve.arrangement, escaped(curve.engine), escaped(curve.preset), slope(bodies),
                          fmt::format("{:.3f}", bodies.r_squared()), touching ? slope(contacts) : "&ndash;",
                          touching ? fmt::format("{:.3f}", contacts.r_squared()) : "&ndash;"});
  }
  table.rows.push_back(
      {kSpaced, "<i>Havok, 2010</i>", "<i>paper</i>", fmt::format("<i>{}</i>", kPaperSpaced_ms), "", "", ""});
  table.rows.push_back(
      {kDense, "<i>Havok, 2010</i>", "<i>paper</i>", fmt::format("<i>{}</i>", kPaperDense_ms), "", "", ""});
  return paragraph("facts", "Straight lines through the mean CPU times (slope &plusmn; standard error):") +
         html_of(table);
}

std::string budgets_table(const std::vector<CostCurve>& curves) {
  TextTable table{.head = {"arrangement", "engine", "preset"}, .texts = 3};
  for (const double period_s : kPeriods_s) {
    for (const char* of : {"mean", "p99"}) table.head.push_back(fmt::format("{:g} ms, {}", 1e3 * period_s, of));
  }
  for (const CostCurve& curve : curves) {
    auto& cells = table.rows.emplace_back(
        std::vector<std::string>{curve.arrangement, escaped(curve.engine), escaped(curve.preset)});
    for (const double period_s : kPeriods_s) {
      for (const char* of : {"mean", "p99"}) cells.push_back(largest(curve, period_s, of).text());
    }
  }
  return paragraph("facts", "The largest sub-world, in bodies, whose step of 1 ms takes no longer than:") +
         html_of(table);
}

void add_costs(Page& page, const Rows& costs, const std::string* pictures, std::size_t count) {
  const std::vector<CostCurve> curves = curves_of(costs);
  page.heading("Cost of a body in a haptic step (the paper's figure 12)");
  page.add(paragraph("facts",
                     "Steps of 1 ms with cubes of 0.1 m: in the air, three widths apart and without contact; and "
                     "poured into a bin that is as wide as the heap is high, after two seconds of settling."));
  page.plots(pictures, count);
  page.add(fits_table(curves) + budgets_table(curves) + cost_rows_table(costs));
}

void add_scene(Page& page, const Rows& rows, const std::vector<const Course*>& courses, const std::string* pictures,
               std::size_t count) {
  page.heading(rows.front().at("scene"));
  page.add(paragraph(
      "facts", fmt::format("{} movable bodies, judged as a {}; {:g} s simulated.", rows.front().at("bodies").dump(),
                           rows.front().at("kind").get<std::string>(), number(rows.front(), "duration_s"))));
  page.plots(pictures, count);
  page.add(runs_table(rows) + error_table(time_steps_of(rows)) + kinetic_table(courses));
}

}  // namespace

void write_report(const std::string& path, const EngineFindings& found) {
  struct Section {
    Rows rows;
    std::vector<const Course*> courses;
    std::size_t first_plot;
    std::size_t plots;
  };
  std::vector<Section> sections;
  std::vector<Plot> plots;
  for (Rows& rows : by_scene(found.rows)) {
    std::vector<const Course*> courses;
    for (const Course& course : found.courses) {
      if (course.row.at("scene") == rows.front().at("scene")) courses.push_back(&course);
    }
    const std::vector<Plot> mine = plots_of(rows, courses);
    sections.push_back({std::move(rows), std::move(courses), plots.size(), mine.size()});
    plots.insert(plots.end(), mine.begin(), mine.end());
  }
  const std::size_t first_cost_plot = plots.size();
  for (Plot& plot : cost_plots(found.costs)) plots.push_back(std::move(plot));
  const std::vector<std::string> pictures = svg_of(plots);

  Page page(path, "Engines: accuracy and run time");
  page.intro(found.summary.at("about"), found.summary);
  std::string choices;
  for (const Json& line : found.summary.at("advice"))
    choices += fmt::format("{}{}", choices.empty() ? "" : "<br>", escaped(line.get<std::string>()));
  if (!choices.empty()) page.add(paragraph("choice", choices));
  page.add(kHowToRead + paragraph("facts", kHeldInWords));
  if (!found.rows.empty()) {
    page.heading("Grades (the paper's Table 2)");
    page.add(grades_matrix(found.rows) + behind_grades(found.rows));
  }
  for (const Section& s : sections) add_scene(page, s.rows, s.courses, pictures.data() + s.first_plot, s.plots);
  if (!found.costs.empty())
    add_costs(page, found.costs, pictures.data() + first_cost_plot, plots.size() - first_cost_plot);
  page.close();
}

}  // namespace subworld
