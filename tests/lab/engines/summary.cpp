#include "lab/engines/summary.hpp"

#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/page/engine_choice.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

namespace {

Json grades_json(const Rows& rows) {
  Json grades = Json::array();
  for (const Rows& scene : by_scene(rows)) {
    if (scene.front().at("kind") != "structure") continue;
    for (const Variant& variant : variants_of(scene)) {
      grades.push_back({{"scene", scene.front().at("scene")},
                        {"engine", variant.engine},
                        {"preset", variant.preset},
                        {"grade", grade(variant)}});
    }
  }
  return grades;
}

Json fits_json(const Rows& costs) {
  const auto line = [](const LineFit& fit) {
    return Json{{"slope_s", fit.slope()}, {"standard_error_s", fit.standard_error()}, {"r_squared", fit.r_squared()}};
  };
  Json fits = Json::array();
  for (const CostCurve& curve : curves_of(costs)) {
    Json fit{{"arrangement", curve.arrangement}, {"engine", curve.engine}, {"preset", curve.preset}};
    fit["per_body"] = line(per_body(curve));
    fit["per_contact"] = curve.arrangement == kDense ? line(per_contact(curve)) : Json(nullptr);
    for (const double period_s : kPeriods_s) {
      const std::string key = fmt::format("bodies_in_{:g}_ms", 1e3 * period_s);
      fit[key] = {{"mean", largest(curve, period_s, "mean").text()}, {"p99", largest(curve, period_s, "p99").text()}};
    }
    fits.push_back(fit);
  }
  return fits;
}

}  // namespace

Json engine_summary(const EnginePlan& plan, const EngineSweep& sweep, const EngineFindings& found) {
  Json summary = begin_summary("engines", found.rows.size(), plan.points.size());
  summary["engines"] = engines_json(sweep.engines);
  std::vector<std::string> about;
  summary["scenes"] = Json::array();
  for (const LabScene& scene : plan.scenes) {
    const bool structure = scene.kind == SceneKind::structure;
    summary["scenes"].push_back(
        {{"scene", scene.scene.name}, {"file", scene.scene.file}, {"kind", structure ? "structure" : "fall"}});
    about.push_back(scene.scene.name);
  }
  summary["about"] = fmt::format("Engines: {}. Scenes: {}.", engines_text(sweep.engines), joined(about, ", "));
  summary["duration_s"] = sweep.duration_s;
  summary["held_means"] = kHeldInWords;
  summary["grade_means"] = kGradesInWords;
  summary["grades"] = grades_json(found.rows);
  summary["figure12"] = fits_json(found.costs);
  summary["advice"] = advice(found.rows, found.costs);
  const auto count = [&](const auto& holds) { return std::ranges::count_if(found.rows, holds); };
  summary["verdict"] = fmt::format("{} runs: {} held, {} failed{}", found.rows.size(),
                                   count([](const Json& row) { return row.at("held").get<bool>(); }),
                                   count([](const Json& row) { return row.at("failure") != ""; }),
                                   stopped_text(found.rows.size(), plan.points.size()));
  return summary;
}

}  // namespace subworld
