#include "world_sim/loops/measures.hpp"

#include "model/shapes/shape_extent.hpp"

#include <fmt/core.h>

#include <algorithm>

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
    : LoopMeasures(options, "world",
                   "time_s,kinetic_energy_j,potential_energy_j,energy_excess_j,step_s,lateness_s,real_time_factor,"
                   "ratio,substeps",
                   {"world_sim", 1}, kWorldStages, say),
      scene_(scene),
      say_(say),
      bodies_(options, scene, say),
      omitted_(static_cast<std::size_t>(scene.settings.users)) {}

void WorldMeasures::end_cycle() noexcept {
  end_step({{Trace::Name::lateness_s, newest_.lateness_s}, {Trace::Name::real_time_factor, newest_real_time_factor_}},
           {{Trace::Name::missed_deadline, newest_.miss != Miss::none}});
}

void WorldMeasures::cycle(const World& world, const StepTimes& times, double real_time_factor, double wall_s) noexcept {
  add(times);
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    omitted_[u].add(static_cast<double>(world.user_facts(u).selection.omitted));
  }
  const WorldFacts& now = world.facts();
  for (const auto broken = world.broken_joints(); broken_joints_ < broken.size(); ++broken_joints_) {
    if (say_)
      say_(fmt::format("joint {} broke at t = {:.3f} s", scene_.joints[broken[broken_joints_]].name, now.time_s));
  }
  const double ratio = now.ratio, substeps = now.substeps;
  ratio_.add(ratio);
  substeps_.add(substeps);
  newest_real_time_factor_ = real_time_factor;
  real_time_factor_min_ = std::min(real_time_factor_min_, real_time_factor);
  simulated_s_ += real_time_factor * wall_s;
  wall_s_ += wall_s;
  if (real_time_factor < 1.0) slowed_s_ += wall_s;
  history_.row({now.time_s, now.kinetic_j, now.potential_j, now.energy_excess_j, times.step_s, times.lateness_s,
                real_time_factor, ratio, substeps});
}

bool WorldMeasures::is_absent(std::size_t user) const noexcept {
  return std::ranges::any_of(absences_, [&](const Absence& one) { return one.user == user && one.to_s == kNotBack_s; });
}

void WorldMeasures::returns(std::size_t user, double at_s) noexcept {
  const auto absence =
      std::ranges::find_if(absences_, [&](const Absence& one) { return one.user == user && one.to_s == kNotBack_s; });
  if (absence != absences_.end()) absence->to_s = at_s;
}

bool WorldMeasures::has_left(std::size_t user) const noexcept {
  return std::ranges::any_of(
      absences_, [&](const Absence& one) { return one.user == user && one.to_s == kNotBack_s && one.by_order; });
}

double WorldMeasures::absent_from_s(std::size_t user) const noexcept {
  double from_s = 0.0;
  for (const Absence& one : absences_) {
    if (one.user == user) from_s = one.from_s;
  }
  return from_s;
}

WorldPart WorldMeasures::result(const World& world, double settle_s) {
  const WorldFacts& end = world.facts();
  WorldPart part{.state_hash = fmt::format("{:016x}", end.state_hash),
                 .simulated_s = end.time_s,
                 .energy_excess_j = end.energy_excess_j,
                 .world = {.bodies = scene_.bodies.size(),
                           .cycles = steps_,
                           .ratio = ratio_,
                           .ratio_changes = end.ratio_changes,
                           .substeps = substeps_,
                           .integration_substep_s = world.engine().integration_substep_s(end.cycle_s / end.substeps),
                           .late_cycles = misses_.all(),
                           .late_by_os = misses_.by_os,
                           .late_by_run = misses_.by_run,
                           .lateness_s = quantiles(lateness_),
                           .real_time_factor_min = real_time_factor_min_,
                           .real_time_factor_mean = wall_s_ > 0.0 ? simulated_s_ / wall_s_ : 1.0,
                           .slowed_s = slowed_s_,
                           .stuck_s = stuck_s_,
                           .released_j = end.released_j,
                           .operators_created_j = end.operators_created_j,
                           .contact_slack_j = contact_slack_j(scene_),
                           .asleep_at_end = world.engine().asleep_count(),
                           .lost_reports = lost_reports_,
                           .refused_reports = refused_reports_,
                           .absences = absences_,
                           .presence = presence_,
                           .engine_changes = engine_changes_,
                           .settle_wall_s = settle_s,
                           .body_history = bodies_.result()}};
  for (std::size_t u = 0; u < omitted_.size(); ++u) {
    const SelectionFacts last = world.user_facts(u).selection;
    part.world.selections.push_back({u, omitted_[u], last.expected_s, last.cost_factor});
  }
  for (Absence& absence : part.world.absences) {
    if (absence.to_s == kNotBack_s) absence.to_s = end.time_s;
  }
  add_to(part.world);
  return part;
}

}  // namespace subworld
