#include "lab/stability/summary.hpp"

#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/stability/run.hpp"
#include "model/joined.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr std::size_t kWorst = 3;  ///< cases in an advice

bool passes(const Json& row) { return row.at("pass").get<bool>(); }

/// The rows of an engine and preset that miss their tolerance, the worst of each case first.
std::vector<const Json*> worst_of(const Rows& rows, const std::string& setting) {
  std::vector<const Json*> missed;
  for (const Json& row : rows) {
    if (setting_of(row) != setting || passes(row)) continue;
    const auto same =
        std::ranges::find_if(missed, [&](const Json* other) { return other->at("case") == row.at("case"); });
    if (same == missed.end()) {
      missed.push_back(&row);
    } else if (margin_of(row) > margin_of(**same)) {
      *same = &row;
    }
  }
  std::ranges::stable_sort(missed, [](const Json* a, const Json* b) { return margin_of(*a) > margin_of(*b); });
  return missed;
}

/// The row with the least error of the same measurement and step.
const Json& best_of(const Rows& rows, const Json& missed) {
  const Json* best = &missed;
  for (const Json& row : rows) {
    if (row.at("step_s") == missed.at("step_s") && label_of(row) == label_of(missed) &&
        margin_of(row) < margin_of(*best))
      best = &row;
  }
  return *best;
}

std::string times_text(double margin) {
  return std::isinf(margin) ? "not measurable" : digits_of(margin, 2) + " times the tolerance";
}

std::string margin_text(double margin) { return margin < 0.01 ? "less than 0.01" : digits_of(margin, 2); }

std::string miss_text(const Rows& rows, const Json& missed) {
  const Json& best = best_of(rows, missed);
  std::string other = "no other is better";
  if (passes(best)) {
    other = fmt::format("{} passes with {}", setting_of(best), margin_text(margin_of(best)));
  } else if (margin_of(best) < 0.5 * margin_of(missed)) {
    other = fmt::format("none passes, the best is {} with {}", setting_of(best), digits_of(margin_of(best), 2));
  }
  return fmt::format("{} at {} s ({}; {})", label_of(missed), step_text(number(missed, "step_s")),
                     times_text(margin_of(missed)), other);
}

std::string advice_of(const Rows& rows, const std::string& setting) {
  const auto mine = [&](const Json& row) { return setting_of(row) == setting; };
  const auto all = std::ranges::count_if(rows, mine);
  const auto good = std::ranges::count_if(rows, [&](const Json& row) { return mine(row) && passes(row); });
  const std::vector<const Json*> missed = worst_of(rows, setting);
  std::vector<std::string> worst;
  for (std::size_t i = 0; i < std::min(kWorst, missed.size()); ++i) worst.push_back(miss_text(rows, *missed[i]));
  const std::string text = fmt::format("{}: {} of {} rows pass", setting, good, all);
  return worst.empty() ? text + "." : fmt::format("{}. The largest misses: {}.", text, joined(worst, "; "));
}

/// Cases that no engine passes in any step.
std::vector<std::string> missed_by_all(const Rows& rows) {
  std::vector<std::string> missed, passed;
  for (const Json& row : rows) (passes(row) ? passed : missed).push_back(label_of(row));
  std::vector<std::string> all;
  for (const std::string& label : missed) {
    if (std::ranges::find(passed, label) == passed.end() && std::ranges::find(all, label) == all.end())
      all.push_back(label);
  }
  return all;
}

}  // namespace

Json stability_summary(const StabilityRequest& request, const Rows& rows, std::size_t planned) {
  Json summary = begin_summary("stability", rows.size(), planned);
  summary["engines"] = engines_json(request.engines);
  summary["quick"] = request.quick;
  summary["about"] = fmt::format("Engines: {}.", engines_text(request.engines));
  summary["settings"] = Json::array();
  summary["advice"] = Json::array();
  for (const std::string& setting : settings_of(rows)) {
    const auto mine = [&](const Json& row) { return setting_of(row) == setting; };
    summary["settings"].push_back(
        {{"setting", setting},
         {"rows", std::ranges::count_if(rows, mine)},
         {"passed", std::ranges::count_if(rows, [&](const Json& row) { return mine(row) && passes(row); })}});
    summary["advice"].push_back(advice_of(rows, setting));
  }
  summary["missed_by_all"] = missed_by_all(rows);
  if (!summary.at("missed_by_all").empty() && !rows.empty())
    summary["advice"].push_back(fmt::format("No engine passes: {}.", joined(missed_by_all(rows), "; ")));
  const auto passed = std::ranges::count_if(rows, passes);
  summary["verdict"] =
      fmt::format("{} measurements: {} pass, {} miss their tolerance, {} of these could not be measured{}", rows.size(),
                  passed, static_cast<long>(rows.size()) - passed,
                  std::ranges::count_if(rows, [](const Json& row) { return row.at("failure") != ""; }),
                  stopped_text(rows.size(), planned));
  return summary;
}

}  // namespace subworld
