#include "world_sim/cycle_plan.hpp"

#include "coupling/plan.hpp"
#include "coupling/sync/synchroniser.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace subworld {

CyclePlan::CyclePlan(const Scene& scene, const Scheme& scheme, const EngineSettings& engine)
    : settings_(scene.settings),
      scheme_(scheme),
      // Who repeats bit by bit and has no choice economises for nobody.
      economises_(settings_.mode == Mode::realtime || settings_.adapts_ratio()),
      timetable_(settings_.ratio, remembered_cycles(settings_, scheme)),
      ratio_control_(settings_),
      engine_cost_(engine_cost(engine)) {}

void CyclePlan::resume(std::uint64_t stamp, std::uint64_t step, int ratio, const RatioChange& planned) {
  timetable_.restart(stamp, step, ratio);
  timetable_.plan(planned);
}

CycleCost CyclePlan::cost(const CycleLoad& load) const {
  return [this, &load](double cycle_s, int parts) {
    return economises_ ? correction_.factor() * published_cost_s(cycle_s, parts, load) : 0.0;
  };
}

int CyclePlan::substeps(std::uint64_t stamp, int present, double longest_s, bool divides, const CycleLoad& load) const {
  // A scheme that minds the world's step minds what the engine makes of it.
  const double for_scheme_s = scheme_.properties.longest_world_step_s;
  const double most_s =
      std::isfinite(for_scheme_s) ? std::min(divides ? for_scheme_s : longest_s, longest_s) : for_scheme_s;
  const auto lead = static_cast<std::uint64_t>(scheme_.properties.lead_cycles);
  return ratio_control_.choose_substeps(present, cycle_s(stamp), most_s, cycle_s(stamp + lead), cost(load));
}

double CyclePlan::ahead_s(double cycle_s) const noexcept {
  return static_cast<double>(planned_cycles(settings_, scheme_)) * cycle_s;
}

bool CyclePlan::choose(std::uint64_t stamp, double cycle_s, bool felt, const CycleLoad& load) {
  const int present = timetable_.ratio(stamp);
  const int ratio = ratio_control_.choose_ratio(present, felt, cycle_s, cost(load));
  timetable_.plan({stamp + planned_cycles(settings_, scheme_), ratio});
  return ratio != present;
}

OrderAnswer CyclePlan::change_ratio(const std::string& text) {
  const RatioBounds whole = settings_.ratio_bounds();
  const std::optional<RatioBounds> wanted = parse_ratio(text);
  if (!wanted) return {OrderState::refused, fmt::format("\"{}\" is no ratio; give one as 4, or two as 4-8", text)};
  if (!settings_.adapts_ratio())
    return {OrderState::refused, fmt::format("the ratio of this run is fixed at {}; start a run with two bounds, as "
                                             "--ratio 4-12, to change it between them",
                                             whole.least)};
  if (wanted->least < whole.least || wanted->most > whole.most)
    return {OrderState::refused, fmt::format("this run was started with --ratio {}; stay within it", to_text(whole))};
  ratio_control_.set_bounds(*wanted);
  return {OrderState::done, fmt::format("ratio {}", to_text(*wanted))};
}

}  // namespace subworld
