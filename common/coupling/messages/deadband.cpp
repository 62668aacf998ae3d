#include "coupling/messages/deadband.hpp"

#include "model/vectors.hpp"

#include <algorithm>

namespace subworld {

namespace {

/// By how much a motion differs, as force and torque of the coupling: (1).
template <class M>
Wrench motion_error(const M& a, const M& b, const CouplingSettings& k) noexcept {
  const double turn_rad = a.pose.orientation.angularDistance(b.pose.orientation);
  const double force_n = k.stiffness_n_m * (a.pose.position - b.pose.position).norm() +
                         k.damping_n_s_m * (a.linear_velocity - b.linear_velocity).norm();
  const double torque_n_m = k.rotational_stiffness_n_m * turn_rad +
                            k.rotational_damping_n_m_s * (a.angular_velocity - b.angular_velocity).norm();
  return {Vec3{force_n, 0.0, 0.0}, Vec3{torque_n_m, 0.0, 0.0}};
}

Wrench difference(const Wrench& a, const Wrench& b) noexcept { return {a.force - b.force, a.torque - b.torque}; }
const Wrench& wrench_of(const DeviceState& state) noexcept { return state.applied; }
const Wrench& wrench_of(const DeviceCommand& command) noexcept { return command.wrench; }

/// Whether a motion of this message has a meaning for its receiver.
bool moves(const DeviceState&, DeviceKind kind) noexcept { return kind == DeviceKind::impedance; }
bool moves(const DeviceCommand&, DeviceKind kind) noexcept { return kind == DeviceKind::admittance; }

template <class M>
M moved_on(const M& sent, double passed_s) noexcept {
  M later = sent;
  later.pose.position += passed_s * sent.linear_velocity;
  later.pose.orientation = rotated(sent.pose.orientation, sent.angular_velocity, passed_s);
  later.stamp_s += passed_s;
  return later;
}

}  // namespace

DeviceState extrapolated(const DeviceState& sent, double passed_s) noexcept { return moved_on(sent, passed_s); }
DeviceCommand extrapolated(const DeviceCommand& sent, double passed_s) noexcept { return moved_on(sent, passed_s); }

template <class M>
bool Deadband<M>::sends(const M& sample, const Wrench& felt, double passed_s) noexcept {
  ++samples_;
  passed_s_ += passed_s;
  bool sends = fraction_ == 0.0 || !sent_ || passed_s_ >= kLongestAbsence_s - 0.5 * passed_s;
  if (!sends) {
    const M there = extrapolated(*sent_, passed_s_);
    const bool motion = moves(sample, user_->device.kind);
    const Wrench error =
        motion ? motion_error(sample, there, user_->coupling) : difference(wrench_of(sample), wrench_of(there));
    sends = error.force.norm() > fraction_ * std::max(felt.force.norm(), kLeastForce_n) ||
            error.torque.norm() > fraction_ * std::max(felt.torque.norm(), kLeastTorque_n_m);
  }
  if (sends) {
    ++sent_count_;
    sent_ = sample;
    passed_s_ = 0.0;
  }
  return sends;
}

template <class M>
M Deadband<M>::pass(const M& sample, const Wrench& felt, double passed_s) noexcept {
  if (sends(sample, felt, passed_s)) return sample;
  M there = extrapolated(*sent_, passed_s_);
  there.sequence = sample.sequence;
  there.stamp_s = sample.stamp_s;
  return there;
}

template class Deadband<DeviceState>;
template class Deadband<DeviceCommand>;

}  // namespace subworld
