#include "lab/session/coupled_run.hpp"

#include "coupling/plan.hpp"
#include "lab/session/cpu_time.hpp"
#include "model/error.hpp"

#include <algorithm>
#include <bit>

namespace subworld {

Scene in_one_world(Scene scene) {
  scene.settings.scheme = "direct";
  scene.settings.set_ratio({1, 1});
  scene.settings.world.substeps = 1;
  scene.settings.delay = {};
  scene.settings.passivity = Passivity::off;
  scene.settings.deadband = 0.0;
  return scene;
}

CoupledRun::CoupledRun(const Scene& scene, const EngineMaker& make)
    : scene_(scene), world(scene_, {}, make), felt(static_cast<std::size_t>(scene_.settings.users)) {
  if (!scene_.settings.presence.empty())
    throw Error(ExitCode::usage,
                "settings.presence: in one process all users take part from start to end; run the "
                "scene by `subworld run`, or remove the key");
  states_.resize(felt.size());
  replayed_.resize(felt.size());
  world.settle([](double) { return true; });
  const Scheme& scheme = scheme_of(scene_.settings);
  for (std::size_t u = 0; u < felt.size(); ++u) {
    subs.push_back(std::make_unique<SubWorld>(scene_, u));
    devices.push_back(std::make_unique<EmulatedDevice>(scene_.users[u].device, static_cast<std::uint32_t>(u)));
    guards.push_back(std::make_unique<DeviceGuard>(scene_, u, 0.0));
    const auto number = static_cast<std::uint32_t>(u);
    Link link{.delay = Delay(scene_.settings, scheme.properties.lead_cycles, number),
              .order = LockstepOrder(scene_, number),
              .deadband = Deadband<DeviceState>(scene_.settings.deadband_in_use(), scene_.users[u]),
              .felt = {},
              .reports = {},
              .frames = {}};
    link.reports.resize(remembered_cycles(scene_.settings, scheme));
    link.frames.resize(link.reports.size());
    links_.push_back(std::move(link));
    subs[u]->synchronise_with(world.frame(u));
    if (scheme.properties.has_sub_worlds) send_report(u);
  }
}

void CoupledRun::know_peers_at_once() {
  for (Link& link : links_) link.order.hear_at_once();
}

void CoupledRun::send_report(std::size_t user) {
  Link& link = links_[user];
  const HapticReport* const report = subs[user]->close_cycle(1);
  if (report == nullptr) return;
  link.reported = true;
  link.newest_report = report->stamp;
  link.reports[report->stamp % link.reports.size()] = *report;
}

void CoupledRun::deliver_reports(std::size_t user) {
  Link& link = links_[user];
  while (link.next_report <= link.newest_report &&
         link.delay.report_due(link.next_report, world.facts().stamp, world.timetable())) {
    const HapticReport* report = &link.reports[link.next_report % link.reports.size()];
    // The report that ends a period of message suppression.
    if (report->stamp != link.next_report) report = &this->report(user);
    link.next_report = report->stamp + 1;
    world.receive(HapticReport(*report));
  }
}

void CoupledRun::deliver_frames(std::size_t user) {
  Link& link = links_[user];
  link.order.take_frames(*subs[user], [&](std::uint64_t stamp) {
    if (stamp > world.facts().stamp) return false;
    const CpuTimer timer(cpu.synchronise);
    subs[user]->synchronise_with(link.frames[stamp % link.frames.size()]);
    return true;
  });
}

void CoupledRun::haptic_step(std::size_t user) {
  const double h = scene_.settings.h_s;
  SubWorld& sub = *subs[user];
  Link& link = links_[user];
  DeviceCommand command;
  FeltStep now;
  {
    const CpuTimer timer(cpu.haptic);
    now = link.order.step(
        sub, states_[user], [&](const DeviceCommand& arrived, const FeltStep&) { command = arrived; },
        [&] { send_report(user); }, haptic_step_s);
  }
  felt[user].force.push_back(now.felt.force);
  const double before_j = guards[user]->port().net_j();
  felt[user].torque.push_back(now.felt.torque);
  const DeviceCommand safe = guards[user]->pass(command, devices[user]->state(), true, h);
  link.felt = safe.wrench;
  felt[user].work_j += std::max(0.0, guards[user]->port().net_j() - before_j);
  felt[user].on_operator.push_back(safe.wrench.force);
  devices[user]->step(safe, h);
  felt[user].proxy.push_back(sub.facts().proxy);
}

void CoupledRun::read_device(std::size_t user) {
  const std::size_t step = felt[user].force.size();
  const DeviceState& read = step < replayed_[user].size() ? replayed_[user][step] : devices[user]->state();
  if (felt.size() > 1) felt[user].device.push_back(read);
  states_[user] = links_[user].deadband.pass(read, links_[user].felt, scene_.settings.h_s);
}

void CoupledRun::haptic_cycles() {
  const bool peers = scheme_of(scene_.settings).properties.replicates_peers;
  const int steps = subs.front()->clock().timetable().ratio(haptic_cycle_++);
  for (int step = 0; step < steps; ++step) {
    for (std::size_t u = 0; u < subs.size(); ++u) {
      deliver_frames(u);
      read_device(u);
    }
    for (std::size_t u = 0; u < subs.size(); ++u) {
      for (std::size_t p = 0; peers && p < subs.size(); ++p) {
        if (p != u) links_[u].order.hear(p, states_[p]);
      }
      haptic_step(u);
    }
  }
  for (std::size_t u = 0; u < subs.size(); ++u) deliver_frames(u);
}

void CoupledRun::cycle() {
  for (Link& link : links_) link.reported = false;
  if (!subs.empty() && haptic_cycle_ <= cycle_) {
    do haptic_cycles();
    while (std::ranges::none_of(links_, &Link::reported));
  }
  const auto lead = static_cast<std::uint64_t>(scheme_of(scene_.settings).properties.lead_cycles);
  ++cycle_;
  if (cycle_ > lead) {
    for (std::size_t u = 0; u < subs.size(); ++u) deliver_reports(u);
    {
      const CpuTimer timer(cpu.world);
      world.step();
    }
    for (std::size_t u = 0; u < subs.size(); ++u) {
      links_[u].frames[world.facts().stamp % links_[u].frames.size()] = world.frame(u);
    }
  }
  for (std::size_t u = 0; u < subs.size(); ++u) deliver_frames(u);
}

bool CoupledRun::finite() const noexcept {
  return world.facts().finite && std::ranges::all_of(subs, [](const auto& sub) { return sub->facts().finite; });
}

std::uint64_t CoupledRun::hash() const noexcept {
  std::uint64_t hash = world.facts().state_hash;
  for (const FeltHistory& user : felt) {
    for (const Vec3& force : user.on_operator) {
      for (int i = 0; i < 3; ++i) hash = (hash ^ std::bit_cast<std::uint64_t>(force[i])) * 0x100000001b3ULL;
    }
  }
  return hash;
}

bool CoupledRun::run() {
  while (finite() && !world.facts().over) cycle();
  return finite();
}

void CoupledRun::close() {
  for (std::size_t u = 0; u < subs.size(); ++u) deliver_reports(u);
  world.close();
}

}  // namespace subworld
