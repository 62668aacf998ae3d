#include "haptic_sim/measures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace subworld {

HapticMeasures::HapticMeasures(const std::string& folder, std::size_t user, History::Flush flush)
    : user_(user),
      history_(folder.empty() ? "" : fmt::format("{}/haptic_{}.csv", folder, user),
               {"time_s",         "force_x_n",    "force_y_n",    "force_z_n",    "hand_force_x_n", "hand_force_y_n",
                "hand_force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m", "proxy_x_m",      "proxy_y_m",
                "proxy_z_m",      "device_x_m",   "device_y_m",   "device_z_m",   "members",        "contacts",
                "border_pairs",   "step_s",       "lateness_s",   "skipped"},
               flush) {}

void HapticMeasures::step(const SubWorld& sub, const FeltStep& felt, double step_s, double lateness_s,
                          bool missed) noexcept {
  ++steps_;
  missed_ += missed;
  step_.add(step_s);
  lateness_.add(lateness_s);
  const auto members = static_cast<double>(sub.members());
  const auto contacts = static_cast<double>(sub.contacts());
  const auto border = static_cast<double>(sub.border_pairs());
  members_.add(members);
  contacts_.add(contacts);
  border_.add(border);
  force_squares_ += felt.felt.force.squaredNorm();
  force_max_ = std::max(force_max_, felt.felt.force.norm());
  watch_force(felt.to_hand.force);
  const Vec3& f = felt.felt.force;
  const Vec3& hand = felt.to_hand.force;
  const Vec3& torque = felt.felt.torque;
  const Vec3 p = sub.proxy().position;
  const Vec3& d = sub.device().pose.position;
  history_.row({sub.time_s(), f.x(),
                f.y(),        f.z(),
                hand.x(),     hand.y(),
                hand.z(),     torque.x(),
                torque.y(),   torque.z(),
                p.x(),        p.y(),
                p.z(),        d.x(),
                d.y(),        d.z(),
                members,      contacts,
                border,       step_s,
                lateness_s,   static_cast<double>(std::exchange(skipped_before_step_, 0))});
}

void HapticMeasures::skipped(int periods) noexcept {
  skipped_ += static_cast<std::uint64_t>(periods);
  missed_ += static_cast<std::uint64_t>(periods);
  skipped_before_step_ += periods;
}

void HapticMeasures::watch_force(const Vec3& force) noexcept {
  force_steps_[steps_ % kForceStepWindow] = (force - last_force_).norm();
  last_force_ = force;
  if (!open_change_ || steps_ < change_settles_at_) return;
  settle_change();
}

void HapticMeasures::settle_change() {
  if (!open_change_) return;
  open_change_->force_step_n = *std::ranges::max_element(force_steps_);
  engine_changes_.push_back(to_json(*open_change_));
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
}

Json HapticMeasures::json(double bytes_per_cycle) {
  settle_change();
  return {{"user", user_},
          {"steps", steps_},
          {"skipped_steps", skipped_},
          {"missed_deadlines", missed_},
          {"lateness_s", quantiles(lateness_)},
          {"step_s", quantiles(step_)},
          {"force_rms_n", steps_ == 0 ? 0.0 : std::sqrt(force_squares_ / static_cast<double>(steps_))},
          {"force_max_n", force_max_},
          {"members", mean_max(members_)},
          {"contacts", mean_max(contacts_)},
          {"border_pairs", mean_max(border_)},
          {"sync_s", quantiles(sync_)},
          {"round_trip_s", quantiles(round_trip_)},
          {"bytes_per_cycle", bytes_per_cycle},
          {"lost_frames", lost_frames_},
          {"resynchronisations", adoptions_},
          {"engine_changes", engine_changes_},
          {"history_rows_dropped", history_.dropped()}};
}

}  // namespace subworld
