#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"

#include <algorithm>

namespace subworld {

/// Observes the energy that crosses a port, counted from the operator into the system.
///
/// Passive: an operator gets back only energy that was put in before. The net energy alone says little, because what
/// friction has used up would count as still there. So the level is that of a tank which holds no more than the virtual
/// coupling can store; what is taken from the empty tank has been created. A coupling at its limit is a constant force
/// that stores what is put in. Bodies that fall or fly onto the proxy bring energy of their own: only the world knows
/// how much.
class EnergyPort {
 public:
  explicit EnergyPort(double capacity_j) noexcept : capacity_j_(capacity_j) {}

  /// `at_limit`: the coupling gives all that the device can.
  void flow(double into_j, bool at_limit) noexcept {
    net_j_ += into_j;
    least_j_ = std::min(least_j_, net_j_);
    level_j_ += into_j;
    if (!at_limit) level_j_ = std::min(level_j_, capacity_j_);
    if (level_j_ >= 0.0) return;
    created_j_ -= level_j_;
    level_j_ = 0.0;
  }

  [[nodiscard]] double net_j() const noexcept { return net_j_; }
  [[nodiscard]] double least_j() const noexcept { return least_j_; }  ///< of the net energy, <= 0
  [[nodiscard]] double level_j() const noexcept { return level_j_; }
  [[nodiscard]] double created_j() const noexcept { return created_j_; }

 private:
  double capacity_j_;
  double net_j_ = 0.0, least_j_ = 0.0, level_j_ = 0.0, created_j_ = 0.0;
};

/// Most that a spring stores below its limit, J. An admittance device has none, and what it moves may bounce: it counts
/// the work of its limit over kStroke_m or kTurn_rad.
[[nodiscard]] constexpr double linear_capacity_j(const UserSpec& user) noexcept {
  constexpr double kStroke_m = 0.02;
  const double limit_n = user.device.force_limit_n;
  return user.device.kind == DeviceKind::impedance ? limit_n * limit_n / (2.0 * user.coupling.stiffness_n_m)
                                                   : kStroke_m * limit_n;
}
[[nodiscard]] constexpr double angular_capacity_j(const UserSpec& user) noexcept {
  constexpr double kTurn_rad = 0.2;
  const double limit_n_m = user.device.torque_limit_n_m;
  const double stiffness = user.coupling.rotational_stiffness_n_m;
  return user.device.kind == DeviceKind::impedance && stiffness > 0.0 ? limit_n_m * limit_n_m / (2.0 * stiffness)
                                                                      : kTurn_rad * limit_n_m;
}

/// The port between a device and its operator.
class OperatorPort {
 public:
  explicit OperatorPort(const UserSpec& user) noexcept
      : kind_(user.device.kind),
        force_limit_n_(user.device.force_limit_n),
        torque_limit_n_m_(user.device.torque_limit_n_m),
        linear_(linear_capacity_j(user)),
        angular_(angular_capacity_j(user)) {}

  /// Once per step, with the device as it is now: what has crossed since the last step. An impedance device has held
  /// the wrench on the operator since then; of an admittance device the operator's own counts, as it is measured.
  void step(const DeviceState& now) noexcept {
    const Wrench of_operator = kind_ == DeviceKind::impedance
                                   ? Wrench{-held_.force, -held_.torque}
                                   : Wrench{0.5 * (before_.applied.force + now.applied.force),
                                            0.5 * (before_.applied.torque + now.applied.torque)};
    if (begun_) {
      constexpr double kAll = 0.999;
      linear_.flow(of_operator.force.dot(now.pose.position - before_.pose.position),
                   of_operator.force.norm() >= kAll * force_limit_n_);
      angular_.flow(of_operator.torque.dot(turn(before_.pose.orientation, now.pose.orientation)),
                    of_operator.torque.norm() >= kAll * torque_limit_n_m_);
    }
    begun_ = true;
    before_ = now;
  }
  /// The wrench on the operator from now on.
  void hold(const Wrench& on_operator) noexcept { held_ = on_operator; }

  [[nodiscard]] const EnergyPort& linear() const noexcept { return linear_; }
  [[nodiscard]] const EnergyPort& angular() const noexcept { return angular_; }
  [[nodiscard]] double net_j() const noexcept { return linear_.net_j() + angular_.net_j(); }
  [[nodiscard]] double least_j() const noexcept { return linear_.least_j() + angular_.least_j(); }
  [[nodiscard]] double created_j() const noexcept { return linear_.created_j() + angular_.created_j(); }

 private:
  static Vec3 turn(const Quat& from, const Quat& to) noexcept {
    const Quat by = to * from.conjugate();
    return 2.0 * (by.w() < 0.0 ? -1.0 : 1.0) * by.vec();  // small angles
  }

  DeviceKind kind_;
  double force_limit_n_, torque_limit_n_m_;
  EnergyPort linear_, angular_;
  bool begun_ = false;
  DeviceState before_;
  Wrench held_;
};

}  // namespace subworld
