#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"

#include <algorithm>

namespace subworld {

/// Observes the energy that crosses a port, counted from the hand into the system.
///
/// What a hand gets back, it must have put in before: a passive system. The net energy alone tells little, because what
/// friction has used up would count as still there. So the level is that of a tank which holds no more than the virtual
/// coupling can store; what is taken from the empty tank has been created. Bodies that fall or fly into the hand bring
/// energy of their own: only the world knows how much.
class EnergyPort {
 public:
  explicit EnergyPort(double capacity_j) noexcept : capacity_j_(capacity_j) {}

  void flow(double into_j) noexcept {
    net_j_ += into_j;
    least_j_ = std::min(least_j_, net_j_);
    level_j_ = std::min(level_j_ + into_j, capacity_j_);
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

/// Most that the springs of a coupling can store: at the device's limits.
[[nodiscard]] constexpr double linear_capacity_j(const UserSpec& user) noexcept {
  const double limit_n = user.device.force_limit_n;
  return limit_n * limit_n / (2.0 * user.coupling.stiffness_n_m);
}
[[nodiscard]] constexpr double angular_capacity_j(const UserSpec& user) noexcept {
  const double limit_n_m = user.device.torque_limit_n_m;
  const double stiffness = user.coupling.rotational_stiffness_n_m;
  return stiffness > 0.0 ? limit_n_m * limit_n_m / (2.0 * stiffness) : 0.0;
}

/// The port between a device and a hand.
class HandPort {
 public:
  explicit HandPort(const UserSpec& user) noexcept
      : kind_(user.device.kind), linear_(linear_capacity_j(user)), angular_(angular_capacity_j(user)) {}

  /// Once per step, with the device as it is now: what has crossed since the last step. An impedance device has held
  /// the wrench on the hand since then; of an admittance device the hand's own counts, as it is measured.
  void step(const DeviceState& now) noexcept {
    const Wrench of_hand = kind_ == DeviceKind::impedance ? Wrench{-held_.force, -held_.torque}
                                                          : Wrench{0.5 * (before_.applied.force + now.applied.force),
                                                                   0.5 * (before_.applied.torque + now.applied.torque)};
    if (begun_) {
      linear_.flow(of_hand.force.dot(now.pose.position - before_.pose.position));
      angular_.flow(of_hand.torque.dot(turn(before_.pose.orientation, now.pose.orientation)));
    }
    begun_ = true;
    before_ = now;
  }
  /// The wrench on the hand from now on.
  void hold(const Wrench& on_hand) noexcept { held_ = on_hand; }

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
  EnergyPort linear_, angular_;
  bool begun_ = false;
  DeviceState before_;
  Wrench held_;
};

}  // namespace subworld
