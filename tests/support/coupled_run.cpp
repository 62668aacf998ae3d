#include "support/coupled_run.hpp"

#include <algorithm>
#include <cmath>

namespace subworld::test {

CoupledRun::CoupledRun(const Scene& scene)
    : scene_(scene), world(scene_), felt(scene.settings.users), proxy(scene.settings.users) {
  world.settle([](double) { return true; });
  for (int u = 0; u < scene_.settings.users; ++u) {
    subs.push_back(std::make_unique<SubWorld>(scene_, u));
    devices.push_back(std::make_unique<EmulatedDevice>(scene_.users[u].device, u));
    subs[u]->apply(world.frame(u));
    reports.push_back(subs[u]->scheme().has_sub_world() ? subs[u]->report(1) : HapticReport{});
  }
}

void CoupledRun::cycle() {
  const double h = scene_.settings.h_s;
  for (std::size_t u = 0; u < subs.size(); ++u) {
    SubWorld& sub = *subs[u];
    EmulatedDevice& device = *devices[u];
    const bool early = sub.scheme().has_sub_world();
    if (early) world.receive(HapticReport(reports[u]));
    for (int i = 0; i < scene_.settings.ratio; ++i) {
      const DeviceState state = device.state();
      const FeltStep step = sub.feel(state, true, h);
      felt[u].push_back(step.felt.force);
      if (!early && i == 0) world.receive(HapticReport(sub.report(1)));
      sub.advance(h);
      DeviceCommand command;
      command.wrench = step.to_hand;
      command.pose.position = sub.proxy().position - sub.clutch();
      command.linear_velocity = sub.proxy().linear_velocity;
      device.step(command, h);
      proxy[u].push_back(sub.proxy());
    }
    if (early) reports[u] = sub.report(1);
  }
  world.step();
  for (std::size_t u = 0; u < subs.size(); ++u) subs[u]->apply(world.frame(u));
}

double rms_error(const std::vector<Vec3>& force, const std::vector<Vec3>& reference) {
  double difference = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < std::min(force.size(), reference.size()); ++i) {
    difference += (force[i] - reference[i]).squaredNorm();
    sum += reference[i].squaredNorm();
  }
  return std::sqrt(difference / sum);
}

}  // namespace subworld::test
