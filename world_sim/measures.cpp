#include "world_sim/measures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace subworld {

WorldMeasures::WorldMeasures(const std::string& folder, const std::string& trace, const History::Say& say,
                             const BodyRecording& recording)
    : history_(folder.empty() ? "" : folder + "/world.csv",
               {"time_s", "kinetic_energy_j", "potential_energy_j", "energy_excess_j", "step_s", "lateness_s",
                "real_time_factor", "ratio", "substeps"},
               say),
      bodies_(folder, recording, say),
      trace_(trace, {"world_sim", 1}, kWorldStages, say) {}

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
  omitted_.resize(world.user_count());
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    omitted_[u].add(static_cast<double>(world.selection(u).omitted));
  }
  const double ratio = world.ratio(), substeps = world.substeps();
  ratio_.add(ratio);
  substeps_.add(substeps);
  newest_late_ = times.miss != Miss::none;
  newest_lateness_s_ = times.lateness_s;
  newest_real_time_factor_ = real_time_factor;
  real_time_factor_min_ = std::min(real_time_factor_min_, real_time_factor);
  simulated_s_ += real_time_factor * wall_s;
  wall_s_ += wall_s;
  if (real_time_factor < 1.0) slowed_s_ += wall_s;
  history_.row({world.time_s(), world.kinetic_energy_j(), world.potential_energy_j(), world.energy_excess_j(),
                times.step_s, times.lateness_s, real_time_factor, ratio, substeps});
}

WorldPart WorldMeasures::result(const World& world, std::size_t bodies, double settle_s) {
  history_.finish();
  std::vector<SelectionResult> selections;
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    const SelectionFacts last = world.selection(u);
    selections.push_back({u, omitted_[u], last.expected_s, last.cost_factor});
  }
  return {.state_hash = fmt::format("{:016x}", world.state_hash()),
          .simulated_s = world.time_s(),
          .energy_excess_j = world.energy_excess_j(),
          .world = {.bodies = bodies,
                    .cycles = cycles_,
                    .ratio = ratio_,
                    .ratio_changes = world.ratio_changes(),
                    .substeps = substeps_,
                    .integration_substep_s = world.integration_substep_s(),
                    .late_cycles = late_.all(),
                    .late_by_os = late_.by_os,
                    .late_by_run = late_.by_run,
                    .woken_late_s = quantiles(woken_late_),
                    .machine = machine_,
                    .step_s = quantiles(step_),
                    .stages = subworld::stages(stages_.times(), kWorldStages),
                    .lateness_s = quantiles(lateness_),
                    .real_time_factor_min = real_time_factor_min_,
                    .real_time_factor_mean = wall_s_ > 0.0 ? simulated_s_ / wall_s_ : 1.0,
                    .slowed_s = slowed_s_,
                    .stuck_s = stuck_s_,
                    .released_j = world.released_j(),
                    .contact_slack_j = world.contact_slack_j(),
                    .asleep_at_end = world.asleep(),
                    .selections = std::move(selections),
                    .lost_reports = lost_reports_,
                    .refused_reports = refused_reports_,
                    .engine_changes = engine_changes_,
                    .settle_wall_s = settle_s,
                    .history_rows_dropped = history_.dropped(),
                    .trace_events_dropped = trace_.dropped(),
                    .body_history = bodies_.result()}};
}

}  // namespace subworld
