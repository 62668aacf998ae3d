#include "world_sim/world.hpp"

#include "coupling/blend.hpp"
#include "model/vectors.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

Pose World::device(std::size_t number) const {
  const User& user = users_[number];
  if (user.held) return user.held->pose;
  const BodyState proxy = engine_.state(user.spec->proxy);
  const Wrench last = saturated(mean_wrench(user.before, user.report), limits_of(user.spec->device));
  const CouplingSettings& coupling = user.tool.coupling;
  Pose device{proxy.position + last.force / coupling.stiffness_n_m, proxy.orientation};
  if (coupling.rotational_stiffness_n_m > 0.0)
    device.orientation = rotated(proxy.orientation, last.torque / coupling.rotational_stiffness_n_m, 1.0);
  return device;
}

void World::hold(std::size_t number) {
  User& user = users_[number];
  user.joins_at.reset();
  if (!user.held) user.held = DevicePose{device(number)};
}

void World::leave(std::size_t number) {
  hold(number);
  User& user = users_[number];
  user.absent = true;
  user.joins_from = facts_.stamp + 1;
  user.heard = false;
  user.waiting.assign(user.waiting.size(), false);
  user.suppression.forget();
  user.synchroniser->forget();
}

void World::begin_without(std::size_t number) {
  leave(number);
  users_[number].joins_from = facts_.stamp;  // no report of an earlier sub-world is on its way
}

void World::begin_join(std::size_t number, const HapticReport& report) {
  hold(number);
  User& user = users_[number];
  const HapticReport& last = user.report;
  const Wrench& applied = user.impulse.applied();
  // The coupling's energy goes on too: what it has more than the one that held the proxy is the user's.
  const double held_j =
      coupling_energy(user.spec->coupling, limits_of(user.spec->device), engine_.state(user.spec->proxy), *user.held);
  user.before_join = {{applied.force - report.impulse_total.force, applied.torque - report.impulse_total.torque},
                      last.device_work_j - held_j + report.coupling_energy_j - report.device_work_j,
                      last.operator_work_j - report.operator_work_j};
  user.started_stamp = report.started_stamp;
  user.joins_at = report.stamp;
  if (std::exchange(user.absent, false)) user.newest_stamp = 0;
}

void World::begin_count(User& user, const HapticReport& report) noexcept {
  const Wrench& impulse = report.impulse_total;
  const bool anew = impulse.force.isZero(0.0) && impulse.torque.isZero(0.0) && report.device_work_j == 0.0 &&
                    report.operator_work_j == 0.0;
  if (anew) return;
  user.before_join = {
      {-impulse.force, -impulse.torque}, report.coupling_energy_j - report.device_work_j, -report.operator_work_j};
}

void World::end_join(User& user) {
  user.held.reset();
  user.joins_at.reset();
  user.impulse.resume(user.before, user.report,
                      seconds(timetable_.start(std::max<std::uint64_t>(report_stamp(), 1) - 1)));
  engine_.set_inertia(user.spec->proxy, user.tool.body.mass, user.tool.body.inertia);
}

}  // namespace subworld
