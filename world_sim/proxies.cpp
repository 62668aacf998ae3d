#include "coupling/virtual_coupling.hpp"
#include "world_sim/world.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

void World::set_rate(User& user, double rate) {
  const double before = std::exchange(user.rate, std::max(rate, kLeastToolRate));
  if (user.rate == before) return;
  const BodyId id = user.spec->proxy;
  user.tool = tool_at(user.rate, *user.spec, scene_.body(id));
  const BodyState proxy = at_rate(engine_.state(id), before, user.rate);
  engine_.set_velocity(id, proxy.linear_velocity, proxy.angular_velocity);
  engine_.set_inertia(id, user.tool.body.mass, user.tool.body.inertia);
}

void World::pull(const User& user, const DevicePose& target, const ForceLimits& limits, double dt) {
  const BodyId id = user.spec->proxy;
  const BodyState proxy = engine_.state(id);
  subworld::hold(engine_, id, implicit_step(user.tool.coupling, limits, user.tool.body, proxy, target, dt));
}

void World::pass_impulses() {
  const std::uint64_t stamp = report_stamp();
  for (User& user : users_) {
    if (user.held) {
      user.mean = coupling_wrench(user.tool.coupling, limits_of(user.spec->device), engine_.state(user.spec->proxy),
                                  *user.held);
    }
    if (!user.heard || user.held) continue;
    const HapticReport& now = user.at(stamp);
    set_rate(user, now.clock_rate);
    user.mean =
        user.impulse.pass(user.before_that(now), now, limits_of(user.spec->device), seconds(timetable_.start(stamp)));
  }
}

void World::drive_proxies(double until_s, double dt) {
  for (const User& user : users_) {
    if (user.held) pull(user, *user.held, limits_of(user.spec->device), dt);
    if (!user.heard || user.held) continue;
    const HapticReport& now = user.at(report_stamp());
    const double moved_until_s = until_s + half_step_offset_s();
    const ProxyDrive drive = side_->drive(*user.spec, user.mean, user.before_that(now), now, moved_until_s);
    if (drive.target) pull(user, *drive.target, drive.limits, dt);
    engine_.apply_force(user.spec->proxy, drive.wrench.force, drive.wrench.torque);
  }
}

}  // namespace subworld
