#include "coupling/virtual_coupling.hpp"

#include <cmath>

namespace subworld {

namespace {

/// Rotation vector (rad) that turns `from` into `to` along the shorter arc.
Vec3 rotation_between(const Quat& from, const Quat& to) noexcept {
  Quat turn = to * from.conjugate();
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
  const double sine = turn.vec().norm();
  if (sine < 1e-12) return 2.0 * turn.vec();
  return 2.0 * std::atan2(sine, turn.w()) / sine * turn.vec();
}

void shorten(Vec3& v, double limit) noexcept {
  const double length = v.norm();
  if (length > limit) v *= limit / length;
}

}  // namespace

Wrench saturated(Wrench wrench, const ForceLimits& limits) noexcept {
  shorten(wrench.force, limits.force_n);
  if (limits.torques) {
    shorten(wrench.torque, limits.torque_n_m);
  } else {
    wrench.torque.setZero();
  }
  return wrench;
}

Wrench coupling_wrench(const CouplingSettings& k, const ForceLimits& limits, const BodyState& proxy,
                       const DevicePose& device) noexcept {
  Wrench wrench;
  wrench.force = k.stiffness_n_m * (device.pose.position - proxy.position) +
                 k.damping_n_s_m * (device.linear_velocity - proxy.linear_velocity);
  if (limits.torques) {
    wrench.torque = k.rotational_stiffness_n_m * rotation_between(proxy.orientation, device.pose.orientation) +
                    k.rotational_damping_n_m_s * (device.angular_velocity - proxy.angular_velocity);
  }
  return saturated(wrench, limits);
}

ImplicitStep implicit_step(const CouplingSettings& k, const ForceLimits& limits, const Body& body,
                           const BodyState& proxy, const DevicePose& device, double dt) noexcept {
  const Wrench now = coupling_wrench(k, limits, proxy, device);
  ImplicitStep step{.mass = body.mass, .inertia = body.inertia, .start = proxy, .wrench = {}};

  step.force_implicit = now.force.norm() < limits.force_n;
  if (!step.force_implicit) {
    step.wrench.force = now.force;
  } else {
    const double added = dt * (k.damping_n_s_m + dt * k.stiffness_n_m);
    step.mass = body.mass + added;
    step.start.linear_velocity *= body.mass / step.mass;
    step.wrench.force =
        k.stiffness_n_m * (device.pose.position - proxy.position) + k.damping_n_s_m * device.linear_velocity;
  }

  if (!limits.torques || !body.rotates) return step;
  step.torque_implicit = now.torque.norm() < limits.torque_n_m;
  if (!step.torque_implicit) {
    step.wrench.torque = now.torque;
  } else {
    const double added = dt * (k.rotational_damping_n_m_s + dt * k.rotational_stiffness_n_m);
    step.inertia = body.inertia.array() + added;
    const Vec3 in_body = proxy.orientation.conjugate() * proxy.angular_velocity;
    step.start.angular_velocity =
        proxy.orientation * Vec3(in_body.cwiseProduct(body.inertia).cwiseQuotient(step.inertia));
    step.wrench.torque = k.rotational_stiffness_n_m * rotation_between(proxy.orientation, device.pose.orientation) +
                         k.rotational_damping_n_m_s * device.angular_velocity;
  }
  return step;
}

Wrench exerted(const CouplingSettings& k, const ImplicitStep& step, const BodyState& after, double dt) noexcept {
  Wrench mean = step.wrench;
  if (step.force_implicit) mean.force -= (k.damping_n_s_m + dt * k.stiffness_n_m) * after.linear_velocity;
  if (step.torque_implicit) {
    mean.torque -= (k.rotational_damping_n_m_s + dt * k.rotational_stiffness_n_m) * after.angular_velocity;
  }
  return mean;
}

double coupling_energy(const CouplingSettings& k, const ForceLimits& limits, const BodyState& proxy,
                       const DevicePose& device) noexcept {
  double energy = 0.5 * k.stiffness_n_m * (device.pose.position - proxy.position).squaredNorm();
  if (limits.torques) {
    energy +=
        0.5 * k.rotational_stiffness_n_m * rotation_between(proxy.orientation, device.pose.orientation).squaredNorm();
  }
  return energy;
}

}  // namespace subworld
