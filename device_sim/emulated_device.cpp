#include "device_sim/emulated_device.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kLongestSubstep_s = 0.25e-3;
constexpr double kServoRate_rad_s = 2.0 * M_PI * 50.0;        ///< bandwidth of an admittance device
constexpr double kVelocityFilter_rad_s = 2.0 * M_PI * 100.0;  ///< of the velocity read from quantised positions
constexpr double kStiction_m_s = 1e-3;                        ///< below, Coulomb friction fades out linearly

Vec3 rotation_vector(const Quat& turn) noexcept {
  const Eigen::AngleAxisd a(turn);
  const double angle = a.angle() > M_PI ? a.angle() - 2.0 * M_PI : a.angle();
  return angle * a.axis();
}

Vec3 bounded(Vec3 v, double limit) noexcept {
  const double length = v.norm();
  return length > limit ? Vec3(v * (limit / length)) : v;
}

void rotate(Quat& q, const Vec3& rate, double dt) noexcept {
  const double angle = rate.norm() * dt;
  if (angle > 0.0) q = (Quat(Eigen::AngleAxisd(angle, rate.normalized())) * q).normalized();
}

}  // namespace

EmulatedDevice::EmulatedDevice(const DeviceSpec& spec, std::uint32_t device)
    : spec_(spec), hand_(spec.hand.value_or(HandSpec{})) {
  state_.device = device;
  const PathPoint start = evaluate(spec_.path, 0.0);
  handle_.position = start.offset.position;
  handle_.orientation = start.offset.orientation;
  publish();
}

void EmulatedDevice::step(const DeviceCommand& received, double dt) noexcept {
  DeviceCommand command = received;
  const bool sound =
      command.wrench.force.allFinite() && command.wrench.torque.allFinite() &&
      finite({command.pose.position, command.pose.orientation, command.linear_velocity, command.angular_velocity});
  if (!sound) {
    command.wrench = {};
    command.pose = {handle_.position, handle_.orientation};
    command.linear_velocity = command.angular_velocity = Vec3::Zero();
  }
  command.wrench = {bounded(command.wrench.force, spec_.force_limit_n),
                    bounded(command.wrench.torque, spec_.torque_limit_n_m)};

  if (!spec_.hand && spec_.kind == DeviceKind::impedance) {
    time_s_ += dt;
    const PathPoint at = evaluate(spec_.path, time_s_);
    handle_ = {at.offset.position, at.offset.orientation, at.linear_velocity, at.angular_velocity};
  } else {
    const int substeps = std::max(1, static_cast<int>(std::ceil(dt / kLongestSubstep_s - 1e-9)));
    for (int i = 0; i < substeps; ++i) {
      time_s_ += dt / substeps;
      if (spec_.kind == DeviceKind::impedance) {
        step_hand(command.wrench, dt / substeps);
      } else {
        follow_command(command, dt / substeps);
      }
    }
    if (spec_.kind == DeviceKind::admittance) press(time_s_);
  }
  ++state_.sequence;
  publish();
}

void EmulatedDevice::step_hand(const Wrench& command, double dt) noexcept {
  const PathPoint wish = evaluate(spec_.path, time_s_);
  const double mass = hand_.mass_kg + spec_.mass_kg;
  const double damping = hand_.damping_n_s_m + spec_.damping_n_s_m;
  const Vec3 pull = hand_.stiffness_n_m * (wish.offset.position - handle_.position) +
                    hand_.damping_n_s_m * wish.linear_velocity + command.force;
  const double speed = handle_.linear_velocity.norm();
  const Vec3 friction =
      speed > 0.0 ? Vec3(-spec_.friction_n * std::min(1.0, speed / kStiction_m_s) / speed * handle_.linear_velocity)
                  : Vec3::Zero();
  // Damping is taken at the end of the step: a light device with a viscous hand stays stable.
  handle_.linear_velocity = (mass * handle_.linear_velocity + dt * (pull + friction)) / (mass + dt * damping);
  handle_.position += dt * handle_.linear_velocity;

  if (spec_.degrees_of_freedom != 6) return;
  const Vec3 twist =
      hand_.rotational_stiffness_n_m * rotation_vector(wish.offset.orientation * handle_.orientation.conjugate()) +
      hand_.rotational_damping_n_m_s * wish.angular_velocity + command.torque;
  handle_.angular_velocity = (hand_.inertia_kg_m2 * handle_.angular_velocity + dt * twist) /
                             (hand_.inertia_kg_m2 + dt * hand_.rotational_damping_n_m_s);
  rotate(handle_.orientation, handle_.angular_velocity, dt);
}

void EmulatedDevice::follow_command(const DeviceCommand& command, double dt) noexcept {
  // A critically damped servo towards the commanded pose, with the commanded velocity fed forward.
  const double w = kServoRate_rad_s;
  const Vec3 a = w * w * (command.pose.position - handle_.position) +
                 2.0 * w * (command.linear_velocity - handle_.linear_velocity);
  handle_.linear_velocity += dt * a;
  handle_.position += dt * handle_.linear_velocity;
  if (spec_.degrees_of_freedom != 6) return;
  const Vec3 b = w * w * rotation_vector(command.pose.orientation * handle_.orientation.conjugate()) +
                 2.0 * w * (command.angular_velocity - handle_.angular_velocity);
  handle_.angular_velocity += dt * b;
  rotate(handle_.orientation, handle_.angular_velocity, dt);
}

void EmulatedDevice::press(double time_s) noexcept {
  const PathPoint wish = evaluate(spec_.path, time_s);
  state_.applied.force = bounded(hand_.stiffness_n_m * (wish.offset.position - handle_.position) +
                                     hand_.damping_n_s_m * (wish.linear_velocity - handle_.linear_velocity),
                                 spec_.force_limit_n);
  if (spec_.degrees_of_freedom != 6) return;
  state_.applied.torque = bounded(
      hand_.rotational_stiffness_n_m * rotation_vector(wish.offset.orientation * handle_.orientation.conjugate()) +
          hand_.rotational_damping_n_m_s * (wish.angular_velocity - handle_.angular_velocity),
      spec_.torque_limit_n_m);
}

void EmulatedDevice::publish() noexcept {
  Vec3 read = handle_.position;
  Vec3 velocity = handle_.linear_velocity;
  if (spec_.position_resolution_m > 0.0) {
    for (int i = 0; i < 3; ++i)
      read[i] = spec_.position_resolution_m * std::round(read[i] / spec_.position_resolution_m);
    const double dt = time_s_ - state_.stamp_s;
    if (dt > 0.0) {
      const double part = 1.0 - std::exp(-kVelocityFilter_rad_s * dt);
      read_velocity_ += part * ((read - state_.pose.position) / dt - read_velocity_);
    }
    velocity = read_velocity_;
  }
  state_.stamp_s = time_s_;
  state_.pose = {read, handle_.orientation};
  state_.linear_velocity = velocity;
  state_.angular_velocity = handle_.angular_velocity;
}

}  // namespace subworld
