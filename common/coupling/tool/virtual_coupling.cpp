#include "coupling/tool/virtual_coupling.hpp"

#include "model/vectors.hpp"
#include "physics/engine.hpp"

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

/// Of a spring whose force stops growing at `limit`.
double spring_energy(double stiffness, double limit, double stretch) noexcept {
  if (stiffness * stretch <= limit) return 0.5 * stiffness * stretch * stretch;
  return limit * (stretch - 0.5 * limit / stiffness);
}

}  // namespace

ForceLimits limits_of(const DeviceSpec& device) noexcept {
  return {device.force_limit_n, device.torque_limit_n_m, device.degrees_of_freedom == 6};
}

Wrench saturated(Wrench wrench, const ForceLimits& limits) noexcept {
  wrench.force = shortened(wrench.force, limits.force_n);
  if (limits.torques) {
    wrench.torque = shortened(wrench.torque, limits.torque_n_m);
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
  ImplicitStep step{.mass = body.mass, .inertia = body.inertia, .start = proxy, .wrench = {}};

  // What decides is the mean force that the step would exert on a free proxy: where the limit cuts it, it is constant.
  const double resistance = k.damping_n_s_m + dt * k.stiffness_n_m;
  const double mass = body.mass + dt * resistance;
  const Vec3 pull =
      k.stiffness_n_m * (device.pose.position - proxy.position) + k.damping_n_s_m * device.linear_velocity;
  const Vec3 free_velocity = (body.mass * proxy.linear_velocity + dt * pull) / mass;
  const Vec3 mean = pull - resistance * free_velocity;
  step.force_implicit = mean.norm() < limits.force_n;
  if (step.force_implicit) {
    step.mass = mass;
    step.start.linear_velocity *= body.mass / mass;
    step.wrench.force = pull;
  } else {
    step.wrench.force = limits.force_n * mean.normalized();
  }

  if (!limits.torques || !body.rotates) return step;
  const double twist_resistance = k.rotational_damping_n_m_s + dt * k.rotational_stiffness_n_m;
  const Vec3 inertia = body.inertia.array() + dt * twist_resistance;
  const Vec3 twist = k.rotational_stiffness_n_m * rotation_between(proxy.orientation, device.pose.orientation) +
                     k.rotational_damping_n_m_s * device.angular_velocity;
  const Quat to_body = proxy.orientation.conjugate();
  const Vec3 momentum = body.inertia.cwiseProduct(to_body * proxy.angular_velocity);
  const Vec3 free_spin = proxy.orientation * Vec3((momentum + dt * (to_body * twist)).cwiseQuotient(inertia));
  const Vec3 mean_torque = twist - twist_resistance * free_spin;
  step.torque_implicit = mean_torque.norm() < limits.torque_n_m;
  if (step.torque_implicit) {
    step.inertia = inertia;
    step.start.angular_velocity = proxy.orientation * Vec3(momentum.cwiseQuotient(inertia));
    step.wrench.torque = twist;
  } else {
    step.wrench.torque = limits.torque_n_m * mean_torque.normalized();
  }
  return step;
}

void hold(Engine& engine, BodyId proxy, const ImplicitStep& step) {
  engine.set_inertia(proxy, step.mass, step.inertia);
  engine.set_velocity(proxy, step.start.linear_velocity, step.start.angular_velocity);
  engine.apply_force(proxy, step.wrench.force, step.wrench.torque);
}

Wrench exerted(const CouplingSettings& k, const ForceLimits& limits, const ImplicitStep& step, const BodyState& after,
               double dt) noexcept {
  Wrench mean = step.wrench;
  if (step.force_implicit) mean.force -= (k.damping_n_s_m + dt * k.stiffness_n_m) * after.linear_velocity;
  if (step.torque_implicit) {
    mean.torque -= (k.rotational_damping_n_m_s + dt * k.rotational_stiffness_n_m) * after.angular_velocity;
  }
  return saturated(mean, limits);
}

double coupling_energy(const CouplingSettings& k, const ForceLimits& limits, const BodyState& proxy,
                       const DevicePose& device) noexcept {
  double energy = spring_energy(k.stiffness_n_m, limits.force_n, (device.pose.position - proxy.position).norm());
  if (limits.torques) {
    energy += spring_energy(k.rotational_stiffness_n_m, limits.torque_n_m,
                            rotation_between(proxy.orientation, device.pose.orientation).norm());
  }
  return energy;
}

}  // namespace subworld
