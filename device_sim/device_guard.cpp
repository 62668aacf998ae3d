#include "device_sim/device_guard.hpp"

#include "coupling/plan.hpp"
#include "coupling/safety/passivity.hpp"

#include <algorithm>

namespace subworld {

namespace {

/// Time in which a device whose motion was bounded returns to the commanded pose, s.
constexpr double kCatchUp_s = 0.02;
constexpr double kDriveLag_s = 0.01;  ///< longest stopping time of the drives: bandwidth 50 Hz, critically damped
constexpr double kSamePlace_m = 1e-9;

}  // namespace

DeviceGuard::DeviceGuard(const Scene& scene, std::size_t user, double fade_in_s)
    : user_(scene.users[user]),
      proxy_mass_kg_(scene.body(user_.proxy).mass),
      proxy_inertia_kg_m2_(scene.body(user_.proxy).inertia.minCoeff()),
      passive_(!enabled(scene, Optimisation::energy_bound, user)),
      force_(operator_limits_of(user_.device), fade_in_s, ForceGuard::Loss::ends_force),
      motion_(user_.device.speed_limit_m_s, user_.device.speed_limit_m_s / kTurnRadius_m),
      port_(scene, user) {}

Wrench DeviceGuard::passive(const Wrench& wanted, const DeviceState& now, double dt) noexcept {
  const Vec3 force =
      passive_force(wanted.force, now.linear_velocity, port_.stored_j(), user_.coupling.stiffness_n_m, dt);
  const double left_j = std::max(0.0, port_.stored_j() - std::max(0.0, dt * force.dot(now.linear_velocity)));
  const Wrench bounded{
      force, passive_force(wanted.torque, now.angular_velocity, left_j, user_.coupling.rotational_stiffness_n_m, dt)};
  bounded_ += bounded.force != wanted.force || bounded.torque != wanted.torque;
  return bounded;
}

DeviceMotion DeviceGuard::passive(DeviceMotion wanted, const DeviceState& now, double dt) noexcept {
  if (apart_) {
    const Vec3 way = wanted.pose.position - moved_.pose.position;
    wanted.linear_velocity += way / kCatchUp_s;
    apart_ = way.norm() > kSamePlace_m;
  }
  // Drives follow with a delay: the remaining motion against the operator counts as energy already spent.
  const Vec3 to_come = (apart_ ? moved_ : wanted).pose.position - now.pose.position + kDriveLag_s * now.linear_velocity;
  const double to_come_j = -now.applied.force.dot(to_come);
  const double stored_j = std::max(0.0, port_.stored_j() - std::max(0.0, to_come_j));
  const Vec3 bounded = passive_velocity(wanted.linear_velocity, now.applied.force, stored_j, proxy_mass_kg_, dt);
  const bool acts = bounded != wanted.linear_velocity;
  bounded_ += acts;
  if (!acts && !apart_) {
    moved_ = wanted;
    return wanted;
  }
  apart_ = true;
  if (stored_j <= 0.0 && to_come_j > 0.0) moved_.pose.position = now.pose.position;
  moved_.pose.position += dt * bounded;
  moved_.pose.orientation = wanted.pose.orientation;
  moved_.linear_velocity = bounded;
  moved_.angular_velocity =
      passive_velocity(wanted.angular_velocity, now.applied.torque, stored_j, proxy_inertia_kg_m2_, dt);
  return moved_;
}

DeviceCommand DeviceGuard::pass(const DeviceCommand& received, const DeviceState& now, bool trusted,
                                double dt) noexcept {
  DeviceCommand command = received;
  // Energy received since the last step may be spent in this one.
  port_.share({received.others_work_j, received.bodies_j});
  port_.step(now);
  ++steps_;
  const bool impedance = user_.device.kind == DeviceKind::impedance;
  const Wrench wanted = passive_ && impedance ? passive(received.wrench, now, dt) : received.wrench;
  command.wrench = force_.pass(wanted, now.linear_velocity, trusted, dt);
  port_.hold(command.wrench);
  oscillation_.step(impedance ? command.wrench.force : now.applied.force, dt);
  if (!impedance) {
    const DeviceMotion target{received.pose, received.linear_velocity, received.angular_velocity};
    const DeviceMotion motion = motion_.pass(passive_ ? passive(target, now, dt) : target, trusted, dt);
    command.pose = motion.pose;
    command.linear_velocity = motion.linear_velocity;
    command.angular_velocity = motion.angular_velocity;
  }
  return command;
}

}  // namespace subworld
