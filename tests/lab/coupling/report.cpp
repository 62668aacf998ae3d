#include "lab/coupling/report.hpp"
#include "io/results/json.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace subworld {

namespace {

constexpr const char* kHowToRead = R"(<p>Each point is the whole system (world, sub-worlds, emulated devices) run in
lock-step in one process. The <b>felt force</b> is compared with that of a <b>reference</b>: the same scene and engine in
one world at the haptic step, without any coupling. The <b>error</b> is the root mean square of the difference over that
of the reference, over all users. The reference is not exact. Its difference from the same world at a quarter of the
step is the <b>reference error</b>. Differences below the reference error are not significant. With
delay, nobody can know the newest motion of another user. The <b>causal error</b> is that of an ideal coupling that
predicts it and has no other error. A setting is <b>at the bound</b> when its error is at most the reference error or 1.1
times the causal error. A
setting is called <b>imperceptible</b> when the RMS error is at most 3.5 %, its 99th percentile at most 7 % of the largest
force, and the force at most 5 ms early or late. The best settings are low and to the left: a small error for little
<b>CPU time</b>. It is the CPU time of world, sub-worlds and synchronisation in seconds per simulated second, without the
network. Errors under 0.01 % are drawn at 0.01 %.</p>
<p class=facts>In the tables, <b>p99</b> and <b>max</b> of the difference are relative to the reference's largest force.
<b>Offset</b> is the lag with the least error, and <b>RMS without offset</b> the error at that lag. <b>ETVO</b> is the
delay and the difference of force that are left when each instant is compared with the one that it renders, of the user
with the largest. <b>Jitter</b> is the
force without its 41-step mean, relative to that of the reference; <b>smoothed</b> is the error of those means. <b>Drift</b>
is the largest distance of a body from its place in the reference, at the end. <b>Energy excess</b> is the world's gain of
energy beyond the work of the devices. <b>Ghosts</b> are the outside bodies that the scheme <i>reduced</i> models. <b>On the operator</b> is the error of the
force behind the device's link, its limits and its passivity bound, against the reference without them. <b>Created</b> is
the energy that the operators received beyond what the couplings could store. The <b>momentum error</b> is the impulse
that the users gave and the world did not receive, over that of all forces. <b>Copies</b> is the distance between two
users' copies of a body.</p>
)";

constexpr int kFewestFitted = 3;  ///< points; an order needs at least as many
constexpr const char* kOrders =
    "Observed order p of error ~ C r<sup>p</sup> (or C h<sup>p</sup>), points above the reference error and without "
    "latency";
constexpr const char* kVariants =
    "Over the variants of the scene, which differ from it in friction, masses and path; the plots are of the scene "
    "itself";

constexpr Column kColumns[] = {{"error RMS %", "force_error_rms", 1e2, 3},
                               {"causal error %", "causal_error", 1e2, 3},
                               {"p99 %", "force_error_p99", 1e2, 3},
                               {"max %", "force_error_max", 1e2, 3},
                               {"offset ms", "time_offset_s", 1e3, 3},
                               {"RMS without offset %", "value_offset", 1e2, 3},
                               {"ETVO time p50 ms", "etvo_time_s", 1e3, 3, "p50"},
                               {"ETVO value p50 N", "etvo_value_n", 1, 3, "p50"},
                               {"jitter ratio", "jitter_ratio", 1, 3},
                               {"smoothed RMS %", "smoothed_force_error_rms", 1e2, 3},
                               {"proxy error RMS mm", "position_error_rms_m", 1e3, 3},
                               {"drift max mm", "drift_max_m", 1e3, 3},
                               {"on the operator: RMS %", "operator_force_error_rms", 1e2, 3},
                               {"p99 %", "operator_force_error_p99", 1e2, 3},
                               {"offset ms", "operator_time_offset_s", 1e3, 3},
                               {"created mJ", "created_j", 1e3, 3},
                               {"momentum error %", "momentum_error_ratio", 1e2, 3},
                               {"copies RMS mm", "copies_rms_m", 1e3, 3},
                               {"energy excess J", "energy_excess_j", 1, 3},
                               {"device work J", "device_work_j", 1, 3},
                               {"members", "members_mean", 1, 3},
                               {"ghosts", "ghosts_mean", 1, 3},
                               {"border pairs", "border_pairs_mean", 1, 3},
                               {"world CPU s/s", "world_cpu_s_per_s", 1, 3},
                               {"haptic CPU s/s", "haptic_cpu_s_per_s", 1, 3},
                               {"synchronise CPU s/s", "synchronise_cpu_s_per_s", 1, 3},
                               {"world step p99 ms", "world_step_s", 1e3, 3, "p99"},
                               {"haptic step p99 ms", "haptic_step_s", 1e3, 3, "p99"}};

std::string marks_of(const Json& row, bool is_dominated) {
  std::string marks;
  const auto add = [&](bool holds, const char* text) {
    if (holds) marks += fmt::format("{}{}", marks.empty() ? "" : ", ", text);
  };
  add(!row.at("survived").get<bool>(), "did not survive");
  add(row.at("at_reference_error").get<bool>(), "<span class=good>at the reference error</span>");
  add(at_causal_bound(row), "<span class=good>at the bound</span>");
  add(imperceptible(row), "<span class=good>imperceptible</span>");
  add(row.at("survived").get<bool>() && is_dominated, "dominated");
  return marks;
}

/// "reduced, r 4, box 0.2 m": scheme, ratio and what else is swept.
std::string setting_text(const Json& row, std::vector<std::string> columns) {
  for (const char* always : {"ratio", "scheme"}) {
    std::erase(columns, always);
    columns.insert(columns.begin(), always);
  }
  return swept_text(row, columns, "");
}

std::string table_of(const Rows& rows) {
  const std::vector<std::string> columns = swept(rows);
  std::string text = "<div class=wide><table><tr><th class=text>setting</th>";
  for (const Column& column : kColumns) text += fmt::format("<th>{}</th>", column.title);
  text += "<th>CPU s/s</th><th class=text>remarks</th></tr>\n";
  for (const Json& row : rows) {
    const bool grey = dominated(row, rows);
    text += fmt::format("<tr{}><td class=text>{}</td>", grey ? " class=dominated" : "",
                        escaped(setting_text(row, columns)));
    for (const Column& column : kColumns) text += fmt::format("<td>{}</td>", cell_of(column, row));
    text += fmt::format("<td>{:.3g}</td><td class=text>{}</td></tr>\n", total_cpu(row), marks_of(row, grey));
  }
  return text +
         "</table></div>\n<p class=facts>Grey, &ldquo;dominated&rdquo;: another point under the same conditions is "
         "better in error or CPU time and not worse in the other; errors below the reference error are equal.</p>\n";
}

constexpr Column kUserColumns[] = {{"error RMS %", "force_error_rms", 1e2, 3},
                                   {"p99 %", "force_error_p99", 1e2, 3},
                                   {"offset ms", "time_offset_s", 1e3, 3},
                                   {"ETVO time p50 ms", "etvo_time_s", 1e3, 3, "p50"},
                                   {"ETVO time p99 ms", "etvo_time_s", 1e3, 3, "p99"},
                                   {"ETVO value p50 N", "etvo_value_n", 1, 3, "p50"},
                                   {"ETVO value p99 N", "etvo_value_n", 1, 3, "p99"},
                                   {"reference error %", "reference_error", 1e2, 3},
                                   {"causal error %", "causal_error", 1e2, 3},
                                   {"on the operator: RMS %", "operator_force_error_rms", 1e2, 3},
                                   {"bounded % of steps", "bounded_ratio", 1e2, 3},
                                   {"work J", "work_j", 1, 3},
                                   {"created % of all work", "created_ratio", 1e2, 3},
                                   {"momentum error %", "momentum_error_ratio", 1e2, 3},
                                   {"copies RMS mm", "copies_rms_m", 1e3, 3},
                                   {"copies max mm", "copies_max_m", 1e3, 3},
                                   {"mutual latency ms", "mutual_latency_s", 1e3, 3}};

/// The users of one scene; empty for a single one, whose figures are in the table of all.
std::string users_of(const Rows& users, const Json& scene) {
  Rows mine;
  std::ranges::copy_if(users, std::back_inserter(mine), [&](const Json& row) { return row.at("scene") == scene; });
  if (std::ranges::all_of(mine, [](const Json& row) { return row.at("user") == 0; })) return "";
  const std::vector<std::string> columns = swept(mine);
  TextTable table{.head = {"user", "setting"}, .rows = {}, .texts = 2, .remarks = true};
  for (const Column& column : kUserColumns) table.head.emplace_back(column.title);
  table.head.emplace_back("remarks");
  for (const Json& row : mine) {
    std::vector<std::string>& cells = table.rows.emplace_back();
    cells = {escaped(row.at("user_name").get<std::string>()), escaped(swept_text(row, columns, ""))};
    for (const Column& column : kUserColumns) cells.push_back(cell_of(column, row));
    cells.emplace_back(at_causal_bound(row) ? "<span class=good>at the bound</span>" : "");
  }
  return "<p>Each user alone (<code>users.csv</code>):</p>\n" + html_of(table);
}

/// The best setting for each budget, under the first conditions.
std::string choices_of(const Rows& rows) {
  if (!comparable(rows.front())) return "";
  std::vector<const Json*> open;
  std::vector<std::string> conditions = conditions_of(rows.front());
  std::erase(conditions, "engine");
  for (const Json& row : rows) {
    if (alike(row, rows.front(), conditions)) open.push_back(&row);
  }
  const std::vector<std::string> columns = swept(rows);
  std::string text;
  for (const double budget : kBudgets) {
    const Json* best = choice(open, budget);
    if (best == nullptr) {
      text += fmt::format("<br>{:g} CPU s per simulated s: no setting is that cheap", budget);
      continue;
    }
    text += fmt::format("<br>{:g} CPU s per simulated s: <b>{}</b>, {:.2g} % for {:.2g} CPU s{}", budget,
                        escaped(swept_text(*best, columns, "")), 100.0 * best->at("force_error_rms").get<double>(),
                        total_cpu(*best), imperceptible(*best) ? ", imperceptible" : "");
  }
  return "<p class=choice>With a budget of" + text + "</p>\n";
}

/// Description of the simulated scene.
std::string facts_of(const Json& scene) {
  const auto engine = [](const Json& e) {
    return fmt::format("{} ({}{})", e.at("engine").get<std::string>(), e.at("preset").get<std::string>(),
                       e.at("iterations").is_null() ? "" : fmt::format(", {} iterations", e.at("iterations").dump()));
  };
  return fmt::format(
      "<p class=facts>{}: {:g} s in steps of {:g} ms after {:g} s of settling; {} bodies, {} user(s), box {:g} m; "
      "coupling {:g} N/m, {:g} N s/m; world {}, sub-worlds {}; where nothing else is swept.</p>\n",
      escaped(scene.at("file").get<std::string>()), scene.at("duration_s").get<double>(),
      1e3 * scene.at("h_s").get<double>(), scene.at("settle_s").get<double>(), scene.at("bodies").get<int>(),
      scene.at("users").get<int>(), scene.at("box_m").get<double>(), scene.at("coupling_stiffness_n_m").get<double>(),
      scene.at("coupling_damping_n_s_m").get<double>(), engine(scene.at("world")), engine(scene.at("haptic")));
}

std::string plan_of(const Json& scene) {
  std::string names;
  for (const Json& item : scene.at("plan")) {
    if (!item.at("enabled").get<bool>() || item.value("user", 0) != 0) continue;
    names += fmt::format("{}<span title=\"{}\">{}</span>", names.empty() ? "" : ", ",
                         escaped(item.at("because").get<std::string>()), item.at("item").get<std::string>());
  }
  if (names.empty()) return "";
  return fmt::format("<p class=facts>Optimisations that are on (subworld plan): {}.</p>\n", names);
}

/// Warning if the reference itself depends on the step.
std::string doubt_of(const Rows& rows) {
  if (!comparable(rows.front())) {
    return "<p class=doubt>The reference has no felt force in this time, so there is no relative error. Run "
           "longer.</p>\n";
  }
  std::vector<const Json*> all;
  for (const Json& row : rows) all.push_back(&row);
  std::string errors;
  for (const Json* row : first_of_each_engine(all)) {
    const double error = number(*row, "reference_error");
    if (!usable(error))
      errors += fmt::format("{}{:.2g} % ({})", errors.empty() ? "" : ", ", 1e2 * error, escaped(row->at("engine")));
  }
  if (errors.empty()) return "";
  return fmt::format(
      "<p class=doubt>The reference error is {}: the reference itself changes with its step, because the "
      "sequence of "
      "contacts changes or because the path's speed jumps. The reference is one of many valid ones, and an error is "
      "only "
      "the difference from this one. No point counts as at the reference error.</p>\n",
      errors);
}

std::string list_of(const char* title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string text = fmt::format("<p>{}:</p>\n<ul>", title);
  for (const std::string& line : lines) text += fmt::format("<li>{}</li>\n", escaped(line));
  return text + "</ul>\n";
}

}  // namespace

std::vector<std::string> orders_of(const Json& fits, const Rows& rows) {
  std::vector<std::string> columns = swept(rows);
  for (const char* other :
       {"scheme", "latency_s", "jitter_s", "device_latency_s", "loss_ratio", "deadband", "passivity"})
    std::erase(columns, other);
  std::vector<std::string> lines;
  for (const Json& fit : fits) {
    if (!alike(fit, rows.front(), {"scene", "variant"}) || fit.at("order").is_null()) continue;
    if (fit.at("points").get<int>() < kFewestFitted) continue;
    const std::string x = fit.at("in");
    const std::string what = swept_text(fit, columns, x);
    lines.push_back(fmt::format("{}{}{}: p = {:.2f} in {} over {} points", fit.at("scheme").get<std::string>(),
                                what.empty() ? "" : ", ", what, fit.at("order").get<double>(), x == "ratio" ? "r" : "h",
                                fit.at("points").get<int>()));
  }
  return lines;
}

std::vector<std::string> variants_of(const Json& over_variants, const Rows& rows) {
  const std::vector<std::string> columns = swept(rows);
  std::vector<std::string> lines;
  for (const Json& over : over_variants) {
    if (over.at("scene") != rows.front().at("scene")) continue;
    const std::string what = swept_text(over, columns, "variant");
    const auto percent = [&](const char* column) { return 100.0 * over.at(column).get<double>(); };
    lines.push_back(
        fmt::format("{}{}median {:.2g} %, worst {:.2g} % of {} (floors {:.2g} to {:.2g} %){}", what,
                    what.empty() ? "" : ": ", percent("force_error_rms_median"), percent("force_error_rms_max"),
                    over.at("variants").get<int>(), percent("reference_error_min"), percent("reference_error_max"),
                    over.at("survived") == over.at("variants")
                        ? ""
                        : fmt::format("; ONLY {} SURVIVED, the errors are theirs", over.at("survived").get<int>())));
  }
  return lines;
}

void write_report(const std::string& path, const Findings& found) {
  struct Section {
    Rows rows;
    std::size_t first_plot;
    std::size_t plots;
  };
  std::vector<Section> sections;
  std::vector<Plot> plots;
  for (Rows& rows : by_scene(found.rows)) sections.push_back({std::move(rows), 0, 0});
  for (Section& section : sections) {
    const std::vector<Plot> mine = plots_of(section.rows, found.traces);
    section.first_plot = plots.size();
    section.plots = mine.size();
    plots.insert(plots.end(), mine.begin(), mine.end());
  }
  const std::vector<std::string> pictures = svg_of(plots);

  Page page(path, "Felt-force error against run time");
  std::string scenes;
  for (const Json& scene : found.summary.at("scenes"))
    scenes += fmt::format("{}{}", scenes.empty() ? "" : ", ", scene.at("scene").get<std::string>());
  page.intro("Scenes: " + scenes, found.summary);
  page.add(kHowToRead);
  for (const Section& section : sections) {
    const std::string scene = section.rows.front().at("scene");
    page.heading(scene);
    const Json& facts =
        *std::ranges::find_if(found.summary.at("scenes"), [&](const Json& s) { return s.at("scene") == scene; });
    page.add(facts_of(facts) + plan_of(facts) + doubt_of(section.rows) + choices_of(section.rows));
    page.plots(pictures.data() + section.first_plot, section.plots);
    page.add(list_of(kOrders, orders_of(found.summary.at("convergence"), section.rows)) +
             list_of(kVariants, variants_of(found.summary.at("over_variants"), section.rows)) + table_of(section.rows) +
             users_of(found.users, scene));
  }
  page.close();
}

}  // namespace subworld
