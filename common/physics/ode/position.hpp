#pragma once

#include "model/types.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace subworld::ode {

/// Separates penetrating bodies by displacements that do not change their velocities. ODE's own correction (ERP) is a
/// velocity that remains: a resting body would hop, and the felt friction would vary.
class PositionCorrection {
 public:
  struct Mover {
    double inverse_mass = 0.0;                                  ///< 1/kg; 0: fixed
    Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Zero();  ///< world frame, 1/(kg m^2)
    Vec3 shift = Vec3::Zero();                                  ///< m
    Vec3 turn = Vec3::Zero();                                   ///< rad
  };

  /// Restarts with movers 0 .. count-1, all immovable.
  void clear(std::size_t count);
  [[nodiscard]] Mover& mover(std::uint32_t i) { return movers_[i]; }
  /// Adds a point with arms from both centres and the normal from b to a. `distance` < 0: penetration (m).
  void add(std::uint32_t a, std::uint32_t b, const Vec3& arm_a, const Vec3& arm_b, const Vec3& normal, double distance);
  /// Computes shifts and turns that remove a share of each penetration and open no new one (projected Gauss-Seidel).
  /// False if there is no penetration.
  bool solve(int iterations);

 private:
  struct Row {
    std::uint32_t a, b;
    Vec3 normal, arm_a_cross_n, arm_b_cross_n;
    Vec3 turn_a, turn_b;  ///< per unit of displacement impulse
    double wanted;        ///< m, along the normal
    double mobility;      ///< m per unit of displacement impulse
    double push = 0.0;
  };
  std::vector<Mover> movers_;
  std::vector<Row> rows_;
  double deepest_ = 0.0;
};

}  // namespace subworld::ode
