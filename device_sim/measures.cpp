#include "device_sim/run.hpp"

#include <fmt/core.h>

namespace subworld {

DeviceMeasures::DeviceMeasures(const Options& options, const History::Say& say)
    : LoopMeasures(options, fmt::format("device_{}", options.user),
                   "time_s,x_m,y_m,z_m,velocity_x_m_s,velocity_y_m_s,velocity_z_m_s,force_x_n,force_y_n,force_z_n,"
                   "qw,qx,qy,qz,angular_velocity_x_rad_s,angular_velocity_y_rad_s,angular_velocity_z_rad_s,"
                   "torque_x_n_m,torque_y_n_m,torque_z_n_m",
                   {fmt::format("device_sim {}", options.user), 200 + options.user}, kDeviceStages, say),
      user_(options.user) {}

void DeviceMeasures::step(const DeviceState& state, const Wrench& wrench, const StepTimes& times) noexcept {
  add(times);
  history_.row_of(state.stamp_s, state.pose.position, state.linear_velocity, wrench.force, state.pose.orientation,
                  state.angular_velocity, wrench.torque);
}

DeviceResult DeviceMeasures::result(const DeviceGuard& guard) {
  DeviceResult result{.user = static_cast<std::size_t>(user_),
                      .steps = steps_,
                      .round_trip_s = quantiles(round_trip_),
                      .sent_ratio = sent_ratio_,
                      .missed_deadlines = misses_.all(),
                      .missed_by_os = misses_.by_os,
                      .missed_by_run = misses_.by_run,
                      .operator_energy = {guard.port().net_j(), guard.port().least_j(), guard.port().created_j()},
                      .energy_bounded_ratio = guard.bounded_ratio(),
                      .oscillation_n = guard.oscillation().worst_n()};
  add_to(result);
  return result;
}

}  // namespace subworld
