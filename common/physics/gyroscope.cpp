#include "physics/gyroscope.hpp"

#include <Eigen/Dense>

#include <cmath>

namespace subworld {

namespace {

constexpr int kNewtonSteps = 12;
constexpr int kEulerSteps = 4;
constexpr double kMiss = 1e-13;      ///< of the momentum
constexpr double kSmall = 1e-4;      ///< rad
constexpr double kIsotropic = 1e-9;  ///< relative difference of the moments

Eigen::Matrix3d cross_matrix(const Vec3& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Matrix3d rotation(const Vec3& turn) {
  const double angle = turn.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
}

/// Maps a change of `turn` to the rotation that it adds, in the world's axes.
Eigen::Matrix3d left_jacobian(const Vec3& turn) {
  const double angle = turn.norm();
  const Eigen::Matrix3d cross = cross_matrix(turn);
  if (angle < kSmall) return Eigen::Matrix3d::Identity() + 0.5 * cross;
  return Eigen::Matrix3d::Identity() + (1.0 - std::cos(angle)) / (angle * angle) * cross +
         (angle - std::sin(angle)) / (angle * angle * angle) * cross * cross;
}

}  // namespace

Vec3 spun_up(const Quat& orientation, const Vec3& inertia, const Vec3& angular_impulse) noexcept {
  return orientation * Vec3((orientation.conjugate() * angular_impulse).cwiseQuotient(inertia));
}

bool feels_gyroscopic_torque(const Vec3& inertia) noexcept {
  return inertia.maxCoeff() - inertia.minCoeff() > kIsotropic * inertia.maxCoeff();
}

FreeTurn turn_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity, double dt) noexcept {
  const Vec3 before = orientation.conjugate() * angular_velocity;
  const Vec3 momentum = inertia.cwiseProduct(before);
  const Eigen::Matrix3d inertia_matrix = inertia.asDiagonal();
  Vec3 after = before;
  for (int i = 0; i < kNewtonSteps; ++i) {
    const Vec3 turn = -0.5 * dt * (before + after);  // of the world, seen from the body
    const Vec3 seen = rotation(turn) * momentum;
    const Vec3 miss = inertia.cwiseProduct(after) - seen;
    if (!(miss.norm() > kMiss * momentum.norm())) {
      if (!after.allFinite()) break;
      return {orientation * Vec3(0.5 * (before + after)), after, true};
    }
    const Eigen::Matrix3d slope = inertia_matrix - 0.5 * dt * cross_matrix(seen) * left_jacobian(turn);
    after -= slope.inverse() * miss;
  }
  return {angular_velocity, before, false};
}

Vec3 FreeTurn::end(const Quat& orientation_after, const Vec3& spin) const noexcept {
  return solved ? Vec3(orientation_after * after + (spin - mean)) : spin;
}

Vec3 turned_freely(const Quat& orientation, const Vec3& inertia, const Vec3& angular_velocity, double dt) noexcept {
  const Vec3 before = orientation.conjugate() * angular_velocity;
  Vec3 after = before;
  for (int i = 0; i < kEulerSteps; ++i) {
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
