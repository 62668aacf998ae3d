#include "coupling/schemes/reduced/ghost_motion.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

constexpr double kCreep_m_s = 1e-3;  ///< of a wall towards what it ought to carry
constexpr double kYield_m_s = 0.02;  ///< of a wall away from a load that nothing in the scene can exert

}  // namespace

Vec3 GhostMotion::along(const Vec3& v) const noexcept {
  Vec3 part = Vec3::Zero();
  for (std::size_t i = 0; i < model.axis_count; ++i) part += v.dot(model.axes[i].normal) * model.axes[i].normal;
  return part;
}

AxisSpring push_of(const PeerPull& peer, const Vec3& normal, double proxy_m, double speed_m_s, double dt) noexcept {
  const auto& [stiffness, damping] = std::pair(peer.coupling.stiffness_n_m, peer.coupling.damping_n_s_m);
  const double pull_n =
      stiffness * (normal.dot(peer.device.pose.position) - proxy_m) + damping * normal.dot(peer.device.linear_velocity);
  const double resistance = damping + dt * stiffness;
  const double mean_n = pull_n - resistance * speed_m_s;
  if (mean_n >= peer.limit_n) return {.force_n = peer.limit_n};
  if (mean_n <= 0.0) return {};
  return {.force_n = pull_n, .added_kg = dt * resistance};
}

double GhostMotion::mass_kg() const noexcept {
  return model.mass_kg + std::ranges::max(springs, {}, &AxisSpring::added_kg).added_kg;
}

Vec3 GhostMotion::force() const noexcept {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < model.axis_count; ++i) {
    sum += (model.axes[i].force_n + springs[i].force_n) * model.axes[i].normal;
  }
  return sum;
}

Vec3 GhostMotion::begin(const Vec3& velocity, double dt, double spare_n) const noexcept {
  Vec3 start = world_velocity - along(world_velocity) + along(velocity);
  const double mass = mass_kg();
  for (std::size_t i = 0; i < model.axis_count; ++i) {
    const GhostAxis& axis = model.axes[i];
    const AxisSpring& spring = springs[i];
    const double speed = velocity.dot(axis.normal);
    const double braked = speed * spring.added_kg / (model.mass_kg + spring.added_kg);
    start -= braked * axis.normal;
    const bool wall = axis.coulomb_limit_n >= kWallLimit_n;
    const double contact_n = std::max(0.0, -load_n.dot(axis.normal));
    const double held_n = wall ? std::min(contact_n, axis.force_n + spare_n) : contact_n;
    // Where the step would end, the load being that of the last one.
    const double end = speed - braked + (axis.force_n + spring.force_n - held_n) / mass * dt;
    if (wall) {
      const double yields = contact_n > held_n ? kYield_m_s * std::min(1.0, contact_n / held_n - 1.0) : 0.0;
      start -= (end - std::clamp(end, -kCreep_m_s, kCreep_m_s) + yields) * axis.normal;
      continue;
    }
    const double limit_n =
        std::max(0.0, axis.coulomb_limit_n + axis.load_dependent_friction.dot(load_n - model.load_n));
    const double limit = limit_n / mass * dt;
    start -= std::clamp(end, -limit, limit) * axis.normal;
  }
  return start;
}

void GhostMotion::end(const Vec3& before, const Vec3& after, double dt) noexcept {
  load_n = mass_kg() / dt * (after - before) - force();
}

}  // namespace subworld
