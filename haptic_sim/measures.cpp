#include "haptic_sim/measures.hpp"

#include <fmt/format.h>

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

HapticMeasures::HapticMeasures(const std::string& folder, const std::string& trace, std::size_t user,
                               const ForceLimits& limits, double h_s, const History::Say& say)
    : user_(user),
      history_(folder.empty() ? "" : fmt::format("{}/haptic_{}.csv", folder, user),
               {"time_s",
                "force_x_n",
                "force_y_n",
                "force_z_n",
                "operator_force_x_n",
                "operator_force_y_n",
                "operator_force_z_n",
                "torque_x_n_m",
                "torque_y_n_m",
                "torque_z_n_m",
                "proxy_x_m",
                "proxy_y_m",
                "proxy_z_m",
                "device_x_m",
                "device_y_m",
                "device_z_m",
                "members",
                "contacts",
                "border_pairs",
                "step_s",
                "lateness_s",
                "skipped"},
               say),
      trace_(trace, {fmt::format("haptic_sim {}", user), 100 + static_cast<int>(user)}, kHapticStages, say),
      limits_(limits),
      h_s_(h_s) {}

void HapticMeasures::step(const SubWorld& sub, const FeltStep& felt, const StepTimes& times) noexcept {
  ++steps_;
  misses_.add(times.miss);
  step_.add(times.step_s);
  lateness_.add(times.lateness_s);
  woken_late_.add(times.woken_late_s);
  const auto members = static_cast<double>(sub.members());
  const auto contacts = static_cast<double>(sub.contacts());
  const auto border = static_cast<double>(sub.border_pairs());
  traced_.members = members;
  traced_.lateness_s = times.lateness_s;
  traced_.missed = traced_.missed || times.miss != Miss::none;
  members_.add(members);
  contacts_.add(contacts);
  border_.add(border);
  coupling_squares_ += felt.felt.force.squaredNorm();
  coupling_max_ = std::max(coupling_max_, felt.felt.force.norm());
  operator_squares_ += felt.to_operator.force.squaredNorm();
  operator_max_ = std::max(operator_max_, felt.to_operator.force.norm());
  at_limit_ += at_limit(felt.to_operator, limits_);
  watch_force(felt.to_operator.force);
  oscillation_.step(felt.to_operator.force, h_s_);
  const Vec3& f = felt.felt.force;
  const Vec3& commanded = felt.to_operator.force;
  const Vec3& torque = felt.felt.torque;
  const Vec3 p = sub.proxy().position;
  const Vec3& d = sub.device().pose.position;
  apart_m_ = std::max(apart_m_, (p - d).norm());
  history_.row({sub.time_s(),
                f.x(),
                f.y(),
                f.z(),
                commanded.x(),
                commanded.y(),
                commanded.z(),
                torque.x(),
                torque.y(),
                torque.z(),
                p.x(),
                p.y(),
                p.z(),
                d.x(),
                d.y(),
                d.z(),
                members,
                contacts,
                border,
                times.step_s,
                times.lateness_s,
                static_cast<double>(std::exchange(skipped_before_step_, 0))});
}

void HapticMeasures::end_step() noexcept {
  const StageStep step = stages_.end();
  trace_.counter(Trace::Name::force_n, step.begin, last_force_.norm());
  trace_.counter(Trace::Name::members, step.begin, traced_.members);
  trace_.counter(Trace::Name::lateness_s, step.begin, traced_.lateness_s);
  if (traced_.missed) trace_.instant(Trace::Name::missed_deadline, step.begin);
  if (traced_.lost_frames) trace_.instant(Trace::Name::lost_frames, step.begin);
  trace_.step(step);
  traced_ = {};
}

void HapticMeasures::skipped(int periods, int by_os) noexcept {
  traced_.missed = traced_.missed || periods > 0;
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
  traced_.lost_frames = traced_.lost_frames || lost_frames > 0;
}

HapticResult HapticMeasures::result(const SubWorld& sub, double bytes_per_cycle) {
  history_.finish();
  settle_change();
  const double steps = std::max(1.0, static_cast<double>(steps_));
  return {
      .user = user_,
      .steps = steps_,
      .skipped_steps = skipped_,
      .missed_deadlines = misses_.all(),
      .missed_by_os = misses_.by_os,
      .missed_by_run = misses_.by_run,
      .missed_waiting = misses_.waiting,
      .lateness_s = quantiles(lateness_),
      .woken_late_s = quantiles(woken_late_),
      .machine = machine_,
      .step_s = quantiles(step_),
      .stages = subworld::stages(stages_.times(), kHapticStages),
      .force_rms_n = std::sqrt(operator_squares_ / steps),
      .force_max_n = operator_max_,
      .force_step_mean_n = force_step_.mean(),
      .force_step_max_n = force_step_.max,
      .at_limit_ratio = static_cast<double>(at_limit_) / steps,
      .proxy_apart_max_m = apart_m_,
      .coupling_force_rms_n = std::sqrt(coupling_squares_ / steps),
      .coupling_force_max_n = coupling_max_,
      .members = members_,
      .contacts = contacts_,
      .border_pairs = border_,
      .sync_s = quantiles(sync_),
      .round_trip_s = quantiles(round_trip_),
      .bytes_per_cycle = bytes_per_cycle,
      .operator_energy = {sub.operator_port().net_j(), sub.operator_port().least_j(), sub.operator_port().created_j()},
      .device_work_j = sub.device_work_j(),
      .oscillation_n = oscillation_.worst_n(),
      .device_jumps = sub.jumps(),
      .lost_frames = lost_frames_,
      .refused_frames = refused_frames_,
      .resynchronisations = resets_,
      .engine_changes = engine_changes_,
      .history_rows_dropped = history_.dropped(),
      .trace_events_dropped = trace_.dropped()};
}

}  // namespace subworld
