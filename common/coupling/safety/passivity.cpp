#include "coupling/safety/passivity.hpp"

#include "model/vectors.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

Vec3 passive_force(const Vec3& wanted_n, const Vec3& velocity_m_s, double stored_j, double stiffness_n_m,
                   double dt) noexcept {
  const double size_n = wanted_n.norm();
  const double bound_n = std::sqrt(2.0 * stiffness_n_m * stored_j);
  if (!(size_n > bound_n)) return wanted_n;
  const double along_m_s = velocity_m_s.dot(wanted_n) / size_n;  // > 0: the operator gets energy
  const double free = std::clamp(-along_m_s / kBlend_m_s, 0.0, 1.0);
  const double most_n = bound_n + free * (size_n - bound_n);
  return shortened(wanted_n, along_m_s > 0.0 ? std::min(most_n, stored_j / (along_m_s * dt)) : most_n);
}

Vec3 passive_velocity(const Vec3& wanted_m_s, const Vec3& operator_n, double stored_j, double mass_kg,
                      double dt) noexcept {
  const double size_m_s = wanted_m_s.norm();
  const double bound_m_s = std::sqrt(2.0 * stored_j / mass_kg);
  if (!(size_m_s > bound_m_s)) return wanted_m_s;
  const double pushed_n = std::max(0.0, operator_n.dot(wanted_m_s) / size_m_s);
  return shortened(wanted_m_s, bound_m_s + pushed_n * dt / mass_kg);
}

}  // namespace subworld
