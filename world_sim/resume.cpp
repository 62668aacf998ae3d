#include "world_sim/checkpoint.hpp"
#include "world_sim/world.hpp"

namespace subworld {

void World::resume(const WorldCheckpoint& from) {
  timetable_.restart(from.stamp, from.haptic_steps, from.ratio);
  timetable_.plan(from.planned);
  facts_.ratio = from.ratio;
  facts_.ratio_changes = from.ratio_changes;
  set_stamp(from.stamp);
  begin_cycle();
  contacts_ = {};  // the first step finds them
  for (const BodyId id : engine_.awake()) motions_[index(id)] = {.state = engine_.state(id)};
  for (std::size_t u = 0; u < users_.size(); ++u) hold(u);  // until its user joins
  account();
  facts_.state_hash = from.state_hash;
  facts_.released_j = from.released_j;
  facts_.energy_excess_j = from.energy_excess_j;
  facts_.operators_created_j = created_before_j_ = from.operators_created_j;
  // The users' work is counted from here on, so the energy is too.
  start_energy_j_ = facts_.kinetic_j + facts_.potential_j;
  make_frames();
}

}  // namespace subworld
