#include "coupling/tool/virtual_coupling.hpp"
#include "world_sim/world.hpp"

namespace subworld {

void World::set_rate(std::size_t user, double rate) {
  const std::optional<double> before = tools_[user].change(rate);
  if (!before) return;
  const BodyState moved = at_rate(proxy(user), *before, tools_[user].rate());
  engine_.set_velocity(scene_.users[user].proxy, moved.linear_velocity, moved.angular_velocity);
  set_inertia(tools_[user].at_rate().body);
}

void World::pull(std::size_t user, const DevicePose& target, const ForceLimits& limits, double dt) {
  const Tool& tool = tools_[user].at_rate();
  subworld::hold(engine_, tool.body.id, implicit_step(tool.coupling, limits, tool.body, proxy(user), target, dt));
}

void World::pass_impulses() {
  const std::uint64_t stamp = report_stamp();
  for (std::size_t u = 0; u < links_.size(); ++u) {
    UserLink& link = links_[u];
    if (link.drives()) set_rate(u, link.reports().at(stamp).clock_rate);
    link.act(stamp, plan_.seconds(plan_.timetable().start(stamp)), proxy(u), tools_[u].at_rate().coupling);
  }
}

void World::drive_proxies(double until_s, double dt) {
  for (std::size_t u = 0; u < links_.size(); ++u) {
    const UserLink& link = links_[u];
    if (link.holds()) pull(u, link.device(proxy(u)), limits_of(link.spec().device), dt);
    if (!link.drives()) continue;
    const HapticReport& now = link.reports().at(report_stamp());
    const double moved_until_s = until_s + half_step_offset_s();
    const ProxyDrive drive = side_->drive(link.spec(), link.wrench(), link.reports().before(now), now, moved_until_s);
    if (drive.target) pull(u, *drive.target, drive.limits, dt);
    engine_.apply_force(link.spec().proxy, drive.wrench.force, drive.wrench.torque);
  }
}

}  // namespace subworld
