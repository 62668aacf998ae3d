#include "lab/latency/report.hpp"

#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr const char* kHowToRead =
    R"(<p>Each point is one run or more of the whole system (world, sub-worlds, emulated devices) in
lock-step in one process, with an artificial delay. In the section of an <b>emulated link</b>, it is a run of the real
programs in real time, with the world and each user on a host of their own and a link between them that delays the
packets. The <b>force on the operator</b>, behind the device's link, its limits
and its passivity bound, is compared with that of a <b>reference</b>: the same scene in one world at the haptic step,
without a delay and without a bound. A run is within the bounds if all of these are at most their bound: the <b>RMS</b>
of the difference over that of the reference; its 99th percentile <b>p99</b>, over the largest force of the reference;
the <b>time offset</b> with the least error; the <b>created energy</b>, which the operator received though
neither the coupling, nor another operator, nor a body had it; the <b>oscillation</b> of the force beyond that of the reference; and
for the device delay the <b>stiffness</b> of the coupling over the largest with which the device comes to rest in
a wall.</p>
<p>The error depends on where in a cycle of the world a contact begins. So a delay that is within the bounds, but nearer
to them than half, is run with the paths beginning at several instants of a cycle, and the largest values count.</p>
<p>The error need not rise with the delay. The <b>limit</b> of a user is the largest measured delay at which, and at all
smaller measured delays, the user is within the bounds. The lab measures a grid of delays, then bisects the interval
before the first failure. The <b>reference error</b> is the difference of the reference from the same world at a quarter
of the step. Where it is larger than a bound, no limit can be decided.</p>
)";

constexpr std::array kColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"};
constexpr const char* kBoundColour = "#b8860b";
constexpr double kLeastShown_percent = 0.01;

bool is_relative(Criterion criterion) { return criterion == Criterion::rms || criterion == Criterion::p99; }

std::string label_of(const CriterionText& text) {
  static constexpr std::array kLabels{"",
                                      "RMS error of the force",
                                      "p99 of the error",
                                      "time offset",
                                      "created energy",
                                      "oscillation",
                                      "stiffness over the largest stable one"};
  const std::string label = kLabels[static_cast<std::size_t>(text.criterion)];
  const bool has_unit = *text.unit != 0 && text.criterion != Criterion::stiffness;
  return has_unit ? fmt::format("{},{}", label, text.unit) : label;
}

/// Whether a user's value is above 0 at some delay, or the criterion is always shown.
bool is_shown(Criterion criterion, const LatencyAnswer& answer) {
  if (criterion == Criterion::unstable) return false;
  if (is_relative(criterion) || criterion == Criterion::offset) return true;
  return std::ranges::any_of(answer.runs, [&](const DelayedRun& run) {
    return std::ranges::any_of(run.users, [&](const Criteria& user) { return user[criterion] > 0.0; });
  });
}

Plot plot_of(const CriterionText& text, const LatencyQuestion& question, const LatencyAnswer& answer) {
  Plot plot{.title = label_of(text),
            .x_label = fmt::format("{}, ms", words_of(question.link)),
            .y_label = label_of(text),
            .log_y = is_relative(text.criterion),
            .x_ticks = {},
            .series = {},
            .levels = {{"bound", kBoundColour, text.scale * question.bounds[text.criterion]}}};
  for (std::size_t u = 0; u < answer.limits.size(); ++u) {
    Series line{.title = answer.limits[u].name,
                .colour = kColours[u % kColours.size()],
                .dashed = u >= kColours.size(),
                .points = {}};
    for (const DelayedRun& run : answer.runs) {
      const double value = text.scale * run.users[u][text.criterion];
      if (!std::isfinite(value) || run.users[u][Criterion::unstable] > 0.0) continue;
      line.points.emplace_back(1e3 * run.delay_s, plot.log_y ? std::max(kLeastShown_percent, value) : value);
    }
    plot.series.push_back(std::move(line));
  }
  return plot;
}

std::string table_of(const LatencyAnswer& answer) {
  TextTable table{.head = {"user", "limit ms", "beyond it ms", "what exceeds its bound", "reference error RMS %"},
                  .remarks = false};
  for (std::size_t u = 0; u < answer.limits.size(); ++u) {
    const auto& [name, limit, undecided] = answer.limits[u];
    const auto ms = [&](const std::optional<double>& s) {
      return s && undecided.empty() ? digits_of(1e3 * *s, 4) : "&ndash;";
    };
    const std::string why = !undecided.empty() ? "cannot be decided: " + undecided
                            : limit.limited_by ? text_of(*limit.limited_by, limit.beyond->values[*limit.limited_by])
                                               : "nothing, up to the largest delay";
    table.rows.push_back({escaped(name), ms(limit.within_s),
                          ms(limit.beyond ? std::optional(limit.beyond->delay_s) : std::nullopt), escaped(why),
                          digits_of(1e2 * answer.reference[u][Criterion::rms], 3)});
  }
  return html_of(table);
}

}  // namespace

std::vector<Plot> plots_of(const LatencyQuestion& question, const LatencyAnswer& answer) {
  std::vector<Plot> plots;
  for (const CriterionText& text : kCriterionTexts) {
    if (is_shown(text.criterion, answer)) plots.push_back(plot_of(text, question, answer));
  }
  return plots;
}

void write_latency_report(const std::string& path, const LatencyFindings& found) {
  std::vector<Plot> plots;
  std::vector<std::size_t> ends;
  for (std::size_t i = 0; i < found.answers.size(); ++i) {
    if (!found.answers[i].runs.empty()) {
      for (Plot& plot : plots_of(found.questions[i], found.answers[i])) plots.push_back(std::move(plot));
    }
    ends.push_back(plots.size());
  }
  const std::vector<std::string> pictures = svg_of(plots);

  Page page(path, "How much latency can I have?");
  page.intro("Force error against the delay, for each user", found.summary);
  page.add(kHowToRead);
  for (std::size_t i = 0, first = 0; i < found.answers.size(); first = ends[i++]) {
    const LatencyAnswer& answer = found.answers[i];
    page.heading(fmt::format("{}, {}{}", answer.settings.at("scene").get<std::string>(),
                             words_of(found.questions[i].link), disturbance_of(answer.settings)));
    page.add(fmt::format("<p class=choice>{}</p>\n", escaped(answer.sentence)));
    page.plots(pictures.data() + first, ends[i] - first);
    page.add(table_of(answer));
  }
  page.close();
}

}  // namespace subworld
