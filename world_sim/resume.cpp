#include "world_sim/checkpoint.hpp"
#include "world_sim/world.hpp"

namespace subworld {

void copy_accounts(const World& world, WorldCheckpoint& to) {
  const WorldFacts& now = world.facts();
  const Timetable& timetable = world.timetable();
  to.engine = now.engine;
  to.stamp = now.stamp;
  to.haptic_steps = timetable.start(now.stamp);
  to.time_s = now.time_s;
  to.ratio = timetable.ratio(now.stamp);
  to.planned = timetable.newest();
  to.ratio_changes = now.ratio_changes;
  to.state_hash = now.state_hash;
  to.kinetic_j = now.kinetic_j;
  to.potential_j = now.potential_j;
  to.energy_excess_j = now.energy_excess_j;
  to.released_j = now.released_j;
  to.operators_created_j = now.operators_created_j;
  for (std::size_t u = 0; u < to.devices.size(); ++u) to.devices[u] = world.device(u);
}

void World::resume(const WorldCheckpoint& from) {
  timetable_.restart(from.stamp, from.haptic_steps, from.ratio);
  timetable_.plan(from.planned);
  facts_.ratio = from.ratio;
  facts_.ratio_changes = from.ratio_changes;
  set_stamp(from.stamp);
  begin_cycle();
  contacts_ = {};  // the first step finds them
  for (const BodyId id : engine_.awake()) motions_[index(id)] = {.state = engine_.state(id)};
  for (std::size_t u = 0; u < users_.size(); ++u) hold_at(users_[u], from.devices[u]);  // until its user joins
  account();
  facts_.state_hash = from.state_hash;
  facts_.released_j = from.released_j;
  facts_.energy_excess_j = from.energy_excess_j;
  facts_.operators_created_j = created_before_j_ = from.operators_created_j;
  // The users' work is counted from here on, so the energy is too.
  start_energy_j_ = facts_.kinetic_j + facts_.potential_j;
  make_frames();
}

void World::hold_at(User& user, const Pose& device) {
  user.held = DevicePose{device};
  const double stored_j =
      coupling_energy(user.spec->coupling, limits_of(user.spec->device), engine_.state(user.spec->proxy), *user.held);
  user.report.device_work_j = user.report.coupling_energy_j = stored_j;
}

}  // namespace subworld
