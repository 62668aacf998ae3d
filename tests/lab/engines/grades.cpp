#include "lab/engines/grades.hpp"

#include "io/results/json.hpp"
#include "lab/engines/body_costs.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <tuple>

namespace subworld {

const char* const kGradesInWords =
    "From the runs with friction and a time step of 1/100 s or more (finer ones if there are no others). -: every run "
    "failed or fell within 2 s, so the structure cannot be simulated. Otherwise the smallest of these time steps "
    "decides. "
    "++: the structure held, was at rest at the end, and no contact was deeper than 5 % of a body's smallest "
    "dimension. "
    "+: it held, but moves or shows penetration; or it broke and was at rest at the end. 0: it broke and was not at "
    "rest "
    "at the end. At rest: RMS speed below 1 % of sqrt(g L), L the longest dimension of a body, over the last half "
    "second.";

namespace {

constexpr double kAtOnce_s = 2.0;              ///< "completely broken in less than 2 seconds" (paper 3.3)
constexpr double kGradedStep_s = 0.01 - 1e-9;  ///< "holds for a time step of 1/100 s" (paper, Table 2)
constexpr double kInfinite = std::numeric_limits<double>::infinity();

std::vector<const Json*> filtered(const Variant& variant, bool friction) {
  std::vector<const Json*> kept;
  for (const Json* row : variant.rows) {
    if ((number(*row, "friction") > 0.0) == friction) kept.push_back(row);
  }
  return kept;
}

bool is_structure(const Json& row) { return row.at("kind") == "structure"; }

std::string about(const Json& row) {
  return fmt::format("{} ({})", row.at("engine").get<std::string>(), row.at("preset").get<std::string>());
}

/// The engine and preset with the most standing structures with friction; of equal ones the cheapest.
std::string for_structures(const Rows& rows) {
  Rows of_structures;
  std::ranges::copy_if(rows, std::back_inserter(of_structures), is_structure);
  std::string best;
  auto best_rank = std::tuple(kInfinite, kInfinite);
  for (const Variant& variant : variants_of(of_structures)) {
    const auto stand = with_friction(variant);
    if (stand.empty()) continue;
    const auto held = std::ranges::count_if(stand, [](const Json* row) { return row->at("held").get<bool>(); });
    double cpu_s = 0.0;
    for (const Json* row : stand) cpu_s += number(*row, "cpu_s_per_simulated_s") / static_cast<double>(stand.size());
    const auto rank = std::tuple(-static_cast<double>(held) / static_cast<double>(stand.size()), cpu_s);
    if (rank >= best_rank) continue;
    best_rank = rank;
    if (held == 0) {
      best = "For stiff structures: none; no run with friction held";
      continue;
    }
    best = fmt::format("For stiff structures: {} ({}): {} of {} runs with friction held, {:.2g} CPU s per simulated s",
                       variant.engine, variant.preset, held, stand.size(), cpu_s);
  }
  return best;
}

/// The engine and preset with the least mean step time in the largest falling scene, if all its runs held.
std::string for_big_worlds(const Rows& rows) {
  double most_bodies = 0.0;
  for (const Json& row : rows) {
    if (!is_structure(row)) most_bodies = std::max(most_bodies, number(row, "bodies"));
  }
  Rows big;
  std::ranges::copy_if(rows, std::back_inserter(big),
                       [&](const Json& row) { return !is_structure(row) && number(row, "bodies") == most_bodies; });
  std::string best;
  auto best_rank = std::tuple(kInfinite, kInfinite);
  for (const Variant& variant : variants_of(big)) {
    const double runs = static_cast<double>(variant.rows.size());
    double lost = 0.0, cpu_s = 0.0;
    for (const Json* row : variant.rows) {
      lost += row->at("held").get<bool>() ? 0.0 : 1.0;
      cpu_s += number(row->at("cpu_step_s"), "mean") / runs;
    }
    const auto rank = std::tuple(lost / runs, cpu_s);
    if (rank >= best_rank) continue;
    best_rank = rank;
    best = fmt::format("For large worlds: {}: {:.3g} CPU ms per step of {:g} bodies, {:g} of {:g} runs held{}",
                       about(*variant.rows.front()), 1e3 * cpu_s, most_bodies, runs - lost, runs,
                       lost == runs ? "; the fastest, as none held" : "");
  }
  return best;
}

/// The engine and preset with the largest dense heap within 1 ms at p99; of equal ones the cheapest per body.
std::string for_sub_worlds(const Rows& costs) {
  std::string best;
  auto best_rank = std::tuple(kInfinite, kInfinite);
  for (const CostCurve& curve : curves_of(costs)) {
    if (curve.arrangement != kDense) continue;
    const Fitting fits = largest(curve, 1e-3, "p99");
    const double slope_s = per_body(curve).slope();
    const auto rank = std::tuple(fits.below ? 0.0 : -fits.bodies, slope_s);
    if (rank >= best_rank) continue;
    best_rank = rank;
    best =
        fmt::format("For haptic sub-worlds: {} ({}): {} bodies of a dense heap within 1 ms at p99, {:.3g} ms per body",
                    curve.engine, curve.preset, fits.text(), 1e3 * slope_s);
  }
  return best;
}

}  // namespace

std::vector<Variant> variants_of(const Rows& rows) {
  std::vector<Variant> variants;
  for (const Json& row : rows) {
    const auto known = std::ranges::find_if(
        variants, [&](const Variant& v) { return row.at("engine") == v.engine && row.at("preset") == v.preset; });
    if (known != variants.end()) {
      known->rows.push_back(&row);
    } else {
      variants.push_back({row.at("engine"), row.at("preset"), {&row}});
    }
  }
  return variants;
}

std::vector<const Json*> with_friction(const Variant& variant) { return filtered(variant, true); }
std::vector<const Json*> without_friction(const Variant& variant) { return filtered(variant, false); }

double longest_stand_s(const std::vector<const Json*>& rows) {
  double longest_s = std::numeric_limits<double>::quiet_NaN();
  for (const Json* row : rows) {
    const bool failed = !row->at("failure").get<std::string>().empty();
    const double stood_s = row->at("held").get<bool>() ? kInfinite : failed ? 0.0 : number(*row, "fell_at_s");
    if (!(stood_s <= longest_s)) longest_s = stood_s;
  }
  return longest_s;
}

std::string grade(const Variant& variant) {
  std::vector<const Json*> rows = with_friction(variant);
  const auto too_fine = [](const Json* row) { return number(*row, "dt_s") < kGradedStep_s; };
  if (!std::ranges::all_of(rows, too_fine)) std::erase_if(rows, too_fine);
  if (rows.empty()) return "";
  if (longest_stand_s(rows) < kAtOnce_s) return "-";
  const Json& finest = **std::ranges::min_element(rows, {}, [](const Json* row) { return number(*row, "dt_s"); });
  const bool at_rest = finest.at("at_rest").get<bool>();
  if (!finest.at("held").get<bool>()) return at_rest ? "+" : "0";
  return at_rest && number(finest, "penetration_ratio") <= kVisibleRatio ? "++" : "+";
}

std::vector<PaperGrade> paper_grades() {
  return {{"stack", "Havok", "++", "frictionless: stood 4 s; a small accordion effect before it collapses"},
          {"stack", "PhysX", "+", "stands a few seconds, visible penetration; frictionless: 1.5 s"},
          {"stack", "Bullet", "+", "4 s at best, at 1/100 s; frictionless: 1 s"},
          {"card_house", "Havok", "++", "stable in every test, within 2 s at friction 1 and 1/100 s"},
          {"card_house", "PhysX", "0", "collapses slowly, 50 s to a quasi-stable state"},
          {"card_house", "Bullet", "-", "completely broken in less than 2 s, whatever the friction"},
          {"basin", "Havok", "", "about 5 steps per s; frictionless: more than 800 ms at the peak"},
          {"basin", "PhysX", "", "about 5 steps per s"},
          {"basin", "Bullet", "", "500 ms per step on average"}};
}

std::vector<std::string> advice(const Rows& rows, const Rows& costs) {
  std::vector<std::string> lines{for_structures(rows), for_big_worlds(rows), for_sub_worlds(costs)};
  std::erase(lines, "");
  return lines;
}

}  // namespace subworld
