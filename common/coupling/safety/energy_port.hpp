#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace subworld {

/// Observes the energy that crosses a port, counted from the operator into the system.
///
/// Passive: an operator gets back only energy that was put in before. The net energy alone says little, because what
/// friction has used up would count as still there. So the level is that of a tank which holds no more than the virtual
/// coupling can store, and the bodies that it moves; what is taken from the empty tank has been created. A coupling at
/// its limit is a constant force that stores what is put in. Bodies that fall or fly onto the proxy bring energy of
/// their own: only the world knows how much.
///
/// Several operators: one may receive what another has put in. What is taken from the empty tank comes first from the
/// energy of the others (OperatorPort), and only what is not there either has been created.
class EnergyPort {
 public:
  explicit EnergyPort(double capacity_j) noexcept : capacity_j_(capacity_j) {}

  /// `at_limit`: the coupling gives all that the device can. `others_j`: energy of the other operators, of which the
  /// port takes what it lacks.
  void flow(double into_j, bool at_limit, double& others_j) noexcept {
    net_j_ += into_j;
    least_j_ = std::min(least_j_, net_j_);
    level_j_ += into_j;
    if (!at_limit) level_j_ = std::min(level_j_, capacity_j_ + bodies_j_);
    if (level_j_ >= 0.0) return;
    const double taken_j = std::min(-level_j_, others_j);
    others_j -= taken_j;
    created_j_ -= level_j_ + taken_j;
    level_j_ = 0.0;
  }
  /// The bodies can give back so much, J.
  void keep(double bodies_j) noexcept { bodies_j_ = bodies_j; }
  /// Another operator has received so much of what this one put in. Returns what the tank does not hold.
  double give(double to_others_j) noexcept {
    const double given_j = std::min(to_others_j, level_j_);
    level_j_ -= given_j;
    return to_others_j - given_j;
  }

  [[nodiscard]] double net_j() const noexcept { return net_j_; }
  [[nodiscard]] double least_j() const noexcept { return least_j_; }  ///< of the net energy, <= 0
  [[nodiscard]] double level_j() const noexcept { return level_j_; }
  [[nodiscard]] double created_j() const noexcept { return created_j_; }

 private:
  double capacity_j_, bodies_j_ = 0.0;
  double net_j_ = 0.0, least_j_ = 0.0, level_j_ = 0.0, created_j_ = 0.0;
};

/// Most that the springs of a coupling store below their limits, J. An admittance device has none, and what it moves
/// may bounce: it counts the work of its limits over kStroke_m and kTurn_rad.
[[nodiscard]] constexpr double capacity_j(const UserSpec& user) noexcept {
  constexpr double kStroke_m = 0.02, kTurn_rad = 0.2;
  const DeviceSpec& device = user.device;
  const auto stored_j = [&](double limit, double stiffness, double way) {
    return device.kind == DeviceKind::impedance && stiffness > 0.0 ? limit * limit / (2.0 * stiffness) : way * limit;
  };
  const double linear_j = stored_j(device.force_limit_n, user.coupling.stiffness_n_m, kStroke_m);
  if (device.degrees_of_freedom != 6) return linear_j;
  return linear_j + stored_j(device.torque_limit_n_m, user.coupling.rotational_stiffness_n_m, kTurn_rad);
}

/// Most that the tanks of the users other than `user` hold, J.
[[nodiscard]] inline double others_capacity_j(const Scene& scene, std::size_t user) noexcept {
  double sum_j = 0.0;
  for (std::size_t u = 0; u < scene.users.size() && static_cast<int>(u) < scene.settings.users; ++u) {
    if (u == user) continue;
    sum_j += capacity_j(scene.users[u]);
  }
  return sum_j;
}

/// The work of an operator on a device, from one step to the next.
class PortWork {
 public:
  explicit PortWork(DeviceKind kind) noexcept : kind_(kind) {}

  struct Work {
    Wrench of_operator;  ///< mean over the step
    double linear_j = 0.0, angular_j = 0.0;
  };
  /// With the device as it is now: what has crossed since the last call; nothing at the first. An impedance device has
  /// held the wrench on the operator since then; of an admittance device the operator's own counts, as it is measured.
  Work step(const Pose& pose, const Wrench& applied) noexcept {
    Work work;
    work.of_operator = kind_ == DeviceKind::impedance
                           ? Wrench{-held_.force, -held_.torque}
                           : Wrench{0.5 * (applied_.force + applied.force), 0.5 * (applied_.torque + applied.torque)};
    if (begun_) {
      work.linear_j = work.of_operator.force.dot(pose.position - pose_.position);
      work.angular_j = work.of_operator.torque.dot(turn(pose_.orientation, pose.orientation));
    }
    begun_ = true;
    pose_ = pose;
    applied_ = applied;
    return work;
  }
  /// The wrench on the operator from now on.
  void hold(const Wrench& on_operator) noexcept { held_ = on_operator; }
  /// The next call of step() is the first.
  void restart() noexcept { begun_ = false; }

 private:
  static Vec3 turn(const Quat& from, const Quat& to) noexcept {
    const Quat by = to * from.conjugate();
    return 2.0 * (by.w() < 0.0 ? -1.0 : 1.0) * by.vec();  // small angles
  }

  DeviceKind kind_;
  bool begun_ = false;
  Pose pose_;
  Wrench applied_, held_;
};

/// What an operator may receive beside the energy that went in through the own port.
struct OthersEnergy {
  double work_j = 0.0;    ///< of the other operators, and of bodies that fall, since the start
  double bodies_j = 0.0;  ///< that the bodies can give back, >= 0
};

/// The port between a device and its operator, with the energy that the other operators have put into the bodies which
/// this one feels. Force and torque have one tank: a tool that turns against an obstacle pushes back with a force.
class OperatorPort {
 public:
  OperatorPort(const Scene& scene, std::size_t user) noexcept
      : force_limit_n_(scene.users[user].device.force_limit_n),
        torque_limit_n_m_(scene.users[user].device.torque_limit_n_m),
        work_(scene.users[user].device.kind),
        own_(capacity_j(scene.users[user])),
        others_capacity_j_(std::max(others_capacity_j(scene, user), capacity_j(scene.users[user]))) {}

  /// Work of the other operators, and of bodies that fall, since the start, J; less than before where operators have
  /// received energy. That is theirs, so it is taken from what they had put in, then from what this one has. A change
  /// that no device can make within a step is a new start of the account.
  void share(const OthersEnergy& others) noexcept {
    if (!std::isfinite(others.work_j) || !std::isfinite(others.bodies_j) || others.bodies_j < 0.0) return;
    own_.keep(others.bodies_j);
    const double into_j = others.work_j - std::exchange(others_work_j_, others.work_j);
    if (!(std::abs(into_j) <= others_capacity_j_)) return;
    others_j_ = std::min(others_j_ + into_j, others_capacity_j_ + others.bodies_j);
    if (others_j_ >= 0.0) return;
    (void)own_.give(-others_j_);
    others_j_ = 0.0;
  }
  /// Once per step, with the device as it is now.
  void step(const DeviceState& now) noexcept {
    constexpr double kAll = 0.999;
    const PortWork::Work work = work_.step(now.pose, now.applied);
    const bool at_limit = work.of_operator.force.norm() >= kAll * force_limit_n_ ||
                          (torque_limit_n_m_ > 0.0 && work.of_operator.torque.norm() >= kAll * torque_limit_n_m_);
    own_.flow(work.linear_j + work.angular_j, at_limit, others_j_);
  }
  /// The wrench on the operator from now on.
  void hold(const Wrench& on_operator) noexcept { work_.hold(on_operator); }

  /// What the operator may be given, J: of the own tank, and of the others' energy.
  [[nodiscard]] double stored_j() const noexcept { return own_.level_j() + others_j_; }
  [[nodiscard]] double net_j() const noexcept { return own_.net_j(); }
  [[nodiscard]] double least_j() const noexcept { return own_.least_j(); }
  [[nodiscard]] double created_j() const noexcept { return own_.created_j(); }

 private:
  double force_limit_n_, torque_limit_n_m_;
  PortWork work_;
  EnergyPort own_;
  double others_capacity_j_;
  double others_work_j_ = 0.0;
  double others_j_ = 0.0;  ///< put in by others and not given to anybody
};

}  // namespace subworld
