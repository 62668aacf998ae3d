#include "world_sim/checkpoint/checkpoint.hpp"
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
  to.broken_joints.assign(world.broken_joints().begin(), world.broken_joints().end());
  for (std::size_t u = 0; u < to.devices.size(); ++u) to.devices[u] = world.device(u);
}

void World::resume(const WorldCheckpoint& from) {
  plan_.resume(from.stamp, from.haptic_steps, from.ratio, from.planned);
  facts_.ratio = from.ratio;
  facts_.ratio_changes = from.ratio_changes;
  set_stamp(from.stamp);
  begin_cycle();
  for (const std::uint32_t joint : from.broken_joints) break_joint(joint);
  contacts_.clear();  // the first step finds them
  for (std::size_t u = 0; u < links_.size(); ++u) links_[u].hold_at(from.devices[u], proxy(u));  // until its user joins
  accounts_.resume(from, engine_, tools_, facts_);
  make_frames();
}

}  // namespace subworld
