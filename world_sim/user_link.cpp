#include "world_sim/user_link.hpp"

#include "coupling/schemes/world_side.hpp"
#include "coupling/tool/virtual_coupling.hpp"
#include "model/vectors.hpp"

namespace subworld {

UserLink::UserLink(const Scheme& scheme, const Scene& scene, std::size_t user)
    : spec_(scene.users[user]), inbox_(scheme, scene), synchroniser_(scheme, scene, user) {
  const BodyState& start = scene.initial[index(spec_.proxy)];
  device_.pose = {start.position, start.orientation};
}

LinkAction UserLink::follow(LinkEvent event, const BodyState& proxy) {
  const auto [to, action] = transition(presence_, event);
  if (holds(to) && !holds()) device_ = device(proxy);
  presence_ = to;
  return action;
}

bool UserLink::receive(HapticReport& report, std::uint64_t now, const BodyState& proxy) {
  if (!inbox_.accepts(report.stamp, now)) return false;
  if (presence_ == UserPresence::held && report.confirmed_stamp < held_at_) return true;
  const bool anew = report.started_stamp >= joins_from_;
  const LinkAction action = follow(anew ? LinkEvent::new_report : LinkEvent::report, proxy);
  if (action == LinkAction::refuse) return false;
  if (action == LinkAction::join) join(report, proxy);
  if (action == LinkAction::count_anew) count_anew(report);
  report.impulse_total.force += baseline_.impulse.force;
  report.impulse_total.torque += baseline_.impulse.torque;
  report.device_work_j += baseline_.device_work_j;
  report.operator_work_j += baseline_.operator_work_j;
  inbox_.put(report);
  return true;
}

void UserLink::join(const HapticReport& report, const BodyState& proxy) noexcept {
  const HapticReport& last = inbox_.newest();
  const Wrench& applied = impulse_.applied();
  // The coupling's energy goes on too: what it has more than the one that held the proxy is the user's.
  baseline_ = {{applied.force - report.impulse_total.force, applied.torque - report.impulse_total.torque},
               last.device_work_j - stored_j(proxy) + report.coupling_energy_j - report.device_work_j,
               last.operator_work_j - report.operator_work_j};
  joins_from_ = report.started_stamp + 1;
  joins_at_ = report.stamp;
}

void UserLink::count_anew(const HapticReport& report) noexcept {
  const Wrench& impulse = report.impulse_total;
  counted_for_another_ = !impulse.force.isZero(0.0) || !impulse.torque.isZero(0.0) || report.device_work_j != 0.0 ||
                         report.operator_work_j != 0.0;
  if (!counted_for_another_) return;
  baseline_ = {
      {-impulse.force, -impulse.torque}, report.coupling_energy_j - report.device_work_j, -report.operator_work_j};
}

bool UserLink::used(std::uint64_t stamp, double until_s) {
  const bool first = awaits();
  inbox_.used(stamp);
  if (first && counted_for_another_) impulse_.resume(inbox_.newest(), inbox_.newest(), until_s);
  if (first && presence_ == UserPresence::present) return true;
  if (presence_ != UserPresence::joining || inbox_.before().stamp < joins_at_) return false;
  if (follow(LinkEvent::two_used, {}) != LinkAction::release) return false;
  impulse_.resume(inbox_.before(), inbox_.newest(), until_s);
  return true;
}

void UserLink::leave(const BodyState& proxy, std::uint64_t joins_from) {
  follow(LinkEvent::leave, proxy);
  joins_from_ = joins_from;
  inbox_.forget();
  synchroniser_.forget();
}

void UserLink::hold_at(const Pose& device, const BodyState& proxy) {
  follow(LinkEvent::timeout, proxy);
  device_ = {.pose = device};
  HapticReport& last = inbox_.newest();
  last.device_work_j = last.coupling_energy_j = stored_j(proxy);
}

double UserLink::stored_j(const BodyState& proxy) const noexcept {
  return coupling_energy(spec_.coupling, limits_of(spec_.device), proxy, device_);
}

DevicePose UserLink::device(const BodyState& proxy) const {
  if (holds()) return device_;
  const Wrench last = saturated(mean_wrench(inbox_.before(), inbox_.newest()), limits_of(spec_.device));
  const CouplingSettings& coupling = spec_.coupling;
  DevicePose device{.pose = {proxy.position + last.force / coupling.stiffness_n_m, proxy.orientation}};
  if (coupling.rotational_stiffness_n_m > 0.0)
    device.pose.orientation = rotated(proxy.orientation, last.torque / coupling.rotational_stiffness_n_m, 1.0);
  return device;
}

void UserLink::act(std::uint64_t stamp, double until_s, const BodyState& proxy, const CouplingSettings& coupling) {
  const ForceLimits limits = limits_of(spec_.device);
  if (holds()) {
    wrench_ = coupling_wrench(coupling, limits, proxy, device_);
    if (awaits()) impulse_.count(wrench_, until_s);
  } else if (drives()) {
    const HapticReport& now = inbox_.at(stamp);
    wrench_ = impulse_.pass(inbox_.before(now), now, limits, until_s);
  }
}

}  // namespace subworld
