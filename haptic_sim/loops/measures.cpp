#include "haptic_sim/loops/measures.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// Whether the device is asked for all that it can give.
bool at_limit(const Wrench& to_operator, const ForceLimits& limits) noexcept {
  constexpr double kAll = 1.0 - 1e-6;  // a saturated wrench is the limit up to rounding
  return to_operator.force.norm() >= kAll * limits.force_n ||
         (limits.torques && to_operator.torque.norm() >= kAll * limits.torque_n_m);
}

}  // namespace

HapticMeasures::HapticMeasures(const Options& options, const Scene& scene, const History::Say& say)
    : LoopMeasures(options, fmt::format("haptic_{}", options.user),
                   "time_s,force_x_n,force_y_n,force_z_n,operator_force_x_n,operator_force_y_n,operator_force_z_n,"
                   "torque_x_n_m,torque_y_n_m,torque_z_n_m,proxy_x_m,proxy_y_m,proxy_z_m,device_x_m,device_y_m,"
                   "device_z_m,device_time_s,members,contacts,border_pairs,step_s,lateness_s,skipped",
                   {fmt::format("haptic_sim {}", options.user), 100 + options.user}, kHapticStages, say),
      user_(options.user),
      limits_(limits_of(scene.users[static_cast<std::size_t>(options.user)].device)),
      h_s_(scene.settings.h_s) {
  history_.hold();
}

void HapticMeasures::step(const SubWorld& sub, const FeltStep& felt, const StepTimes& times) noexcept {
  add(times);
  const SubWorldFacts& now = sub.facts();
  const auto members = static_cast<double>(now.members);
  newest_members_ = members;
  const auto contacts = static_cast<double>(now.contacts);
  const auto border = static_cast<double>(now.border_pairs);
  missed_ = missed_ || times.miss != Miss::none;
  members_.add(members);
  contacts_.add(contacts);
  border_.add(border);
  coupling_squared_.add(felt.felt.force.squaredNorm());
  operator_squared_.add(felt.to_operator.force.squaredNorm());
  at_limit_.add(at_limit(felt.to_operator, limits_) ? 1.0 : 0.0);
  watch_force(felt.to_operator.force);
  oscillation_.step(felt.to_operator.force, h_s_);
  const Vec3 &proxy = now.proxy.position, &device = sub.device().pose().pose.position;
  apart_m_ = std::max(apart_m_, (proxy - device).norm());
  history_.row_of(now.time_s, felt.felt.force, felt.to_operator.force, felt.felt.torque, proxy, device,
                  sub.device().stamp_s(), members, contacts, border, times.step_s, times.lateness_s,
                  std::exchange(skipped_before_step_, 0));
}

void HapticMeasures::end_step() noexcept {
  LoopMeasures::end_step({{Trace::Name::force_n, last_force_.norm()},
                          {Trace::Name::members, newest_members_},
                          {Trace::Name::lateness_s, newest_.lateness_s}},
                         {{Trace::Name::missed_deadline, missed_}, {Trace::Name::lost_frames, lost_}});
  missed_ = lost_ = false;
}

void HapticMeasures::skipped(int periods, int by_os) noexcept {
  missed_ = missed_ || periods > 0;
  skipped_ += static_cast<std::uint64_t>(periods);
  misses_.skip(periods, by_os);
  skipped_before_step_ += periods;
}

void HapticMeasures::watch_force(const Vec3& force) noexcept {
  const double change_n = (force - last_force_).norm();
  force_steps_[steps_ % kForceStepWindow] = change_n;
  force_step_.add(change_n);
  last_force_ = force;
  if (!open_change_ || steps_ < change_settles_at_) return;
  settle_change();
}

void HapticMeasures::settle_change() {
  if (!open_change_) return;
  open_change_->force_step_n = *std::ranges::max_element(force_steps_);
  engine_changes_.push_back(*open_change_);
  settled_change_ = std::exchange(open_change_, std::nullopt);
}

void HapticMeasures::engine_changed(const EngineChange& change) {
  settle_change();
  open_change_ = change;
  open_change_->force_step_before_n = *std::ranges::max_element(force_steps_);
  change_settles_at_ = steps_ + kForceStepWindow;
}

void HapticMeasures::synchronised(double seconds, std::uint64_t lost_frames) noexcept {
  sync_.add(seconds);
  lost_frames_ += lost_frames;
  lost_ = lost_ || lost_frames > 0;
}

HapticResult HapticMeasures::result(const SubWorld& sub, double bytes_per_cycle) {
  settle_change();
  const OperatorPort& port = sub.device().port();
  HapticResult result{.user = static_cast<std::size_t>(user_),
                      .steps = steps_,
                      .skipped_steps = skipped_,
                      .missed_deadlines = misses_.all(),
                      .missed_by_os = misses_.by_os,
                      .missed_by_run = misses_.by_run,
                      .missed_waiting = misses_.waiting,
                      .lateness_s = quantiles(lateness_),
                      .force_rms_n = std::sqrt(operator_squared_.mean()),
                      .force_max_n = std::sqrt(operator_squared_.max),
                      .force_step_mean_n = force_step_.mean(),
                      .force_step_max_n = force_step_.max,
                      .at_limit_ratio = at_limit_.mean(),
                      .proxy_apart_max_m = apart_m_,
                      .coupling_force_rms_n = std::sqrt(coupling_squared_.mean()),
                      .coupling_force_max_n = std::sqrt(coupling_squared_.max),
                      .members = members_,
                      .contacts = contacts_,
                      .border_pairs = border_,
                      .sync_s = quantiles(sync_),
                      .round_trip_s = quantiles(round_trip_),
                      .bytes_per_cycle = bytes_per_cycle,
                      .sent_ratio = sent_ratio_,
                      .operator_energy = {port.net_j(), port.least_j(), port.created_j()},
                      .device_work_j = sub.facts().device_work_j,
                      .oscillation_n = oscillation_.worst_n(),
                      .device_jumps = sub.device().jumps(),
                      .late_reports_ratio = static_cast<double>(lacked_reports_) /
                                            static_cast<double>(std::max<std::uint64_t>(1, frames_)),
                      .lost_frames = lost_frames_,
                      .refused_frames = refused_frames_,
                      .resynchronisations = resets_,
                      .engine_changes = engine_changes_};
  add_to(result);
  return result;
}

}  // namespace subworld
