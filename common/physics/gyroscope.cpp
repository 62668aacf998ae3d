#include "physics/gyroscope.hpp"

#include <cmath>

namespace subworld {

namespace {

constexpr int kNewtonSteps = 4;
constexpr double kIsotropic = 1e-9;  ///< relative difference of the moments

Eigen::Matrix3d cross_matrix(const Vec3& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace

Vec3 spun_up(const Quat& orientation, const Vec3& inertia, const Vec3& angular_impulse) noexcept {
  return orientation * Vec3((orientation.conjugate() * angular_impulse).cwiseQuotient(inertia));
}

bool feels_gyroscopic_torque(const Vec3& inertia) noexcept {
  return inertia.maxCoeff() - inertia.minCoeff() > kIsotropic * inertia.maxCoeff();
}

Vec3 turned_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity, double dt) noexcept {
  const Vec3 before = orientation.conjugate() * angular_velocity;
  Vec3 after = before;
  for (int i = 0; i < kNewtonSteps; ++i) {
    const Vec3 mean = 0.5 * (before + after);
    const Vec3 momentum = inertia.cwiseProduct(mean);
    const Vec3 miss = inertia.cwiseProduct(after - before) - dt * momentum.cross(mean);
    const Eigen::Matrix3d inertia_matrix = inertia.asDiagonal();
    const Eigen::Matrix3d slope =
        inertia_matrix - 0.5 * dt * (cross_matrix(momentum) - cross_matrix(mean) * inertia_matrix);
    after -= slope.inverse() * miss;
  }
  // The rotation was too fast for the rule to converge: limit the energy at least.
  const double energy_before = inertia.dot(before.cwiseAbs2());
  const double energy_after = inertia.dot(after.cwiseAbs2());
  if (!after.allFinite() || energy_after <= 0.0) return angular_velocity;
  return orientation * Vec3(after * std::sqrt(energy_before / energy_after));
}

}  // namespace subworld
