#include "world_sim/measures.hpp"

#include "model/shape_extent.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

/// What lifts every body by as much as engines let contacts overlap, J.
double contact_slack_j(const Scene& scene) {
  constexpr double kOverlap = 0.02;  // of a body's thickness
  double sum_j = 0.0;
  for (const Body& body : scene.bodies) {
    if (body.fixed() || !body.gravity) continue;
    sum_j += body.mass * scene.settings.world.gravity.norm() * kOverlap * thickness(body.shape, scene.meshes);
  }
  return sum_j;
}

}  // namespace

WorldMeasures::WorldMeasures(const Options& options, const Scene& scene, const History::Say& say)
    : scene_(scene),
      history_(options.out.empty() ? "" : options.out + "/world.csv",
               {"time_s", "kinetic_energy_j", "potential_energy_j", "energy_excess_j", "step_s", "lateness_s",
                "real_time_factor", "ratio", "substeps"},
               say),
      bodies_(options.out, body_recording(options, scene), say),
      trace_(options.trace, {"world_sim", 1}, kWorldStages, say),
      omitted_(static_cast<std::size_t>(scene.settings.users)) {}

void WorldMeasures::end_cycle() noexcept {
  const StageStep step = stages_.end();
  trace_.counter(Trace::Name::lateness_s, step.begin, newest_lateness_s_);
  trace_.counter(Trace::Name::real_time_factor, step.begin, newest_real_time_factor_);
  if (newest_late_) trace_.instant(Trace::Name::missed_deadline, step.begin);
  trace_.step(step);
}

void WorldMeasures::cycle(const World& world, const StepTimes& times, double real_time_factor, double wall_s) noexcept {
  ++cycles_;
  late_.add(times.miss);
  step_.add(times.step_s);
  lateness_.add(times.lateness_s);
  woken_late_.add(times.woken_late_s);
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    omitted_[u].add(static_cast<double>(world.user_facts(u).selection.omitted));
  }
  const WorldFacts& now = world.facts();
  const double ratio = now.ratio, substeps = now.substeps;
  ratio_.add(ratio);
  substeps_.add(substeps);
  newest_late_ = times.miss != Miss::none;
  newest_lateness_s_ = times.lateness_s;
  newest_real_time_factor_ = real_time_factor;
  real_time_factor_min_ = std::min(real_time_factor_min_, real_time_factor);
  simulated_s_ += real_time_factor * wall_s;
  wall_s_ += wall_s;
  if (real_time_factor < 1.0) slowed_s_ += wall_s;
  history_.row({now.time_s, now.kinetic_j, now.potential_j, now.energy_excess_j, times.step_s, times.lateness_s,
                real_time_factor, ratio, substeps});
}

Json WorldMeasures::json(const World& world, double settle_s) {
  history_.finish();
  const WorldFacts& end = world.facts();
  Json selections = Json::array();
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    const SelectionFacts last = world.user_facts(u).selection;
    selections.push_back({{"user", u},
                          {"omitted", mean_max(omitted_[u])},
                          {"expected_step_s", last.expected_s},
                          {"cost_factor", last.cost_factor}});
  }
  return {{"state_hash", fmt::format("{:016x}", end.state_hash)},
          {"simulated_s", end.time_s},
          {"energy_excess_j", end.energy_excess_j},
          {"world",
           {{"bodies", scene_.bodies.size()},
            {"cycles", cycles_},
            {"ratio", mean_max(ratio_)},
            {"ratio_changes", end.ratio_changes},
            {"substeps", mean_max(substeps_)},
            {"integration_substep_s", world.engine().integration_substep_s(end.cycle_s / end.substeps)},
            {"late_cycles", late_.all()},
            {"late_by_os", late_.by_os},
            {"late_by_run", late_.by_run},
            {"woken_late_s", quantiles(woken_late_)},
            {"machine", machine_.json()},
            {"step_s", quantiles(step_)},
            {"stages", subworld::stages(stages_.times(), kWorldStages)},
            {"lateness_s", quantiles(lateness_)},
            {"real_time_factor_min", real_time_factor_min_},
            {"real_time_factor_mean", wall_s_ > 0.0 ? simulated_s_ / wall_s_ : 1.0},
            {"slowed_s", slowed_s_},
            {"stuck_s", stuck_s_},
            {"released_j", end.released_j},
            {"contact_slack_j", contact_slack_j(scene_)},
            {"asleep_at_end", world.engine().asleep_count()},
            {"selections", selections},
            {"lost_reports", lost_reports_},
            {"refused_reports", refused_reports_},
            {"engine_changes", engine_changes_},
            {"settle_wall_s", settle_s},
            {"history_rows_dropped", history_.dropped()},
            {"trace_events_dropped", trace_.dropped()}}}};
}

}  // namespace subworld
