#include "lab/random/report.hpp"

#include "io/results/json.hpp"
#include "lab/page/engine_choice.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr const char* kWhatItIs = R"(<p>Each scene is drawn from the seed and run twice in lock-step, world and
sub-worlds in the engine and preset of the row. A run fails if it crashes, if a state is not finite, if the second run
ends with another hash, if the force on an operator leaves its limits, or if the bodies of the world gain unexplained
energy: more than 1 % of the energy that users, corrections, gravity and the initial motion put in. <b>Bouncing</b> counts
the failures that disappear without restitution. <b>Worst gain</b> is the largest unexplained energy over the energy put
in. <b>Operator energy</b> counts operators that received created energy with passivity on. A failing scene is shrunk and
saved; <code>subworld run FILE</code> shows it.</p>
)";

struct Count {
  const char* title;
  const char* key;
  Fault fault;
};
constexpr Count kCounts[] = {{"crashes", "crashes", Fault::crash},
                             {"exceptions", "exceptions", Fault::exception},
                             {"not finite", "not_finite", Fault::not_finite},
                             {"hash", "hash", Fault::hash},
                             {"force", "force", Fault::force},
                             {"energy", "energy", Fault::energy},
                             {"operator energy", "operator_energy", Fault::port}};

Json counts_of(const Rows& rows, const std::string& setting) {
  Json counts = {{"setting", setting}, {"scenes", 0}};
  for (const Count& count : kCounts) counts[count.key] = 0;
  int bounces = 0;
  double worst = 0.0, cpu_s = 0.0;
  for (const Json& row : rows) {
    if (setting_of(row) != setting) continue;
    counts["scenes"] = counts["scenes"].get<int>() + 1;
    for (const Count& count : kCounts) {
      if (row.at("fault") == kFaultNames[static_cast<std::size_t>(count.fault)])
        counts[count.key] = counts[count.key].get<int>() + 1;
    }
    bounces += row.at("bounces").get<bool>();
    if (row.at("energy_gain_ratio").is_number()) worst = std::max(worst, number(row, "energy_gain_ratio"));
    cpu_s += number(row, "cpu_s");
  }
  counts["bounces"] = bounces;
  counts["worst_gain_ratio"] = worst;
  counts["cpu_s"] = cpu_s;
  return counts;
}

std::string cell(const Json& value) {
  return value.is_number_integer() ? fmt::format("{}", value.get<int>())
         : value.is_number()       ? fmt::format("{:.3g}", value.get<double>())
                                   : value.get<std::string>();
}

std::vector<std::string> head() {
  std::vector<std::string> titles{"engine and preset", "scenes"};
  for (const Count& count : kCounts) titles.emplace_back(count.title);
  titles.insert(titles.end(), {"bouncing", "worst gain", "CPU s"});
  return titles;
}

std::vector<std::string> cells_of(const Json& counts) {
  std::vector<std::string> cells;
  for (const auto& [key, value] : counts.items()) cells.push_back(cell(value));
  return cells;
}

}  // namespace

Json random_summary(const RandomRequest& request, const Rows& rows) {
  Json summary = {{"seed", request.seed}, {"scenes", rows.size()}, {"settings", Json::array()}};
  for (const std::string& setting : settings_of(rows)) summary["settings"].push_back(counts_of(rows, setting));
  summary["failures"] = Json::array();
  for (const Json& row : rows) {
    if (row.at("fault") == kFaultNames[0]) continue;
    summary["failures"].push_back({{"setting", setting_of(row)},
                                   {"seed", row.at("seed")},
                                   {"scene", row.at("scene")},
                                   {"fault", row.at("fault")},
                                   {"reason", row.at("reason")},
                                   {"file", row.at("file")}});
  }
  return summary;
}

bool all_held(const Json& summary) { return summary.at("failures").empty(); }

std::string random_verdict(const Json& summary, const std::string& cases) {
  const std::size_t all = summary.at("scenes"), failed = summary.at("failures").size();
  return fmt::format("{}{}{} runs of random scenes: {} held, {} failed", cases, cases.empty() ? "" : "; ", all,
                     all - failed, failed);
}

std::string random_text(const Json& summary) {
  std::string text = fmt::format("random scenes of seed {}:\n  {:<22}", summary.at("seed").get<std::uint64_t>(), "");
  const std::vector<std::string> titles = head();
  for (std::size_t i = 1; i < titles.size(); ++i) text += fmt::format("{:>12}", titles[i]);
  for (const Json& counts : summary.at("settings")) {
    const std::vector<std::string> cells = cells_of(counts);
    text += fmt::format("\n  {:<22}", cells[0]);
    for (std::size_t i = 1; i < cells.size(); ++i) text += fmt::format("{:>12}", cells[i]);
  }
  return text + "\n";
}

void add_random_section(Page& page, const Json& summary) {
  page.heading("Random scenes");
  page.add(fmt::format("<p>{} scenes of seed {}.</p>\n", summary.at("scenes").get<std::size_t>(),
                       summary.at("seed").get<std::uint64_t>()) +
           kWhatItIs);
  TextTable counts{.head = head()};
  for (const Json& one : summary.at("settings")) counts.rows.push_back(cells_of(one));
  page.add(html_of(counts));
  if (summary.at("failures").empty()) return;
  TextTable failures{
      .head = {"engine and preset", "seed", "scene", "fault", "reason", "file"}, .texts = 1, .remarks = true};
  for (const Json& one : summary.at("failures")) {
    failures.rows.push_back({escaped(one.at("setting")), cell(one.at("seed")), cell(one.at("scene")),
                             escaped(one.at("fault")), escaped(one.at("reason")), escaped(one.at("file"))});
  }
  page.add(html_of(failures));
}

}  // namespace subworld
