#include "device_sim/emulated_device.hpp"

#include "model/hash.hpp"
#include "model/vectors.hpp"

#include <unsupported/Eigen/MatrixFunctions>

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kLongestSubstep_s = 0.25e-3;  ///< for the path, and for all quantities without an exact solution
constexpr double kServoRate_rad_s = 2.0 * M_PI * 50.0;        ///< bandwidth of an admittance device
constexpr double kVelocityFilter_rad_s = 2.0 * M_PI * 100.0;  ///< of the velocity read from quantised positions
constexpr double kSameTime = 1e-6;                            ///< relative tolerance of a tick's time

}  // namespace

EmulatedDevice::EmulatedDevice(const DeviceSpec& spec, std::uint32_t device)
    : spec_(spec), operator_(spec.operator_model.value_or(OperatorSpec{})) {
  state_.device = device;
  const PathPoint start = evaluate(spec_.path, 0.0, spec_.profile);
  handle_.position = start.offset.position;
  handle_.orientation = start.offset.orientation;
  if (operator_.tremor.amplitude_m > 0.0) begin_tremor(device);
  read_sensors();
}

void EmulatedDevice::begin_tremor(std::uint32_t device) noexcept {
  const auto draw = [&](std::uint64_t number) {
    return static_cast<double>(random_bits(3 * static_cast<std::uint64_t>(device) + number) >> 11U) * 0x1.0p-53;
  };
  const double w = 2.0 * M_PI * operator_.tremor.frequency_hz, m = operator_.mass_kg + spec_.mass_kg;
  const double impedance_n_m =
      std::hypot(operator_.stiffness_n_m - m * w * w, w * (operator_.damping_n_s_m + spec_.damping_n_s_m));
  const double up = 2.0 * draw(0) - 1.0, aside = std::sqrt(1.0 - up * up), around = 2.0 * M_PI * draw(1);
  tremor_n_ =
      operator_.tremor.amplitude_m * impedance_n_m * Vec3(aside * std::cos(around), aside * std::sin(around), up);
  tremor_phase_rad_ = 2.0 * M_PI * draw(2);
}

Vec3 EmulatedDevice::tremor(double time_s) const noexcept {
  if (operator_.tremor.amplitude_m == 0.0) return Vec3::Zero();
  return std::sin(2.0 * M_PI * operator_.tremor.frequency_hz * time_s + tremor_phase_rad_) * tremor_n_;
}

PathPoint EmulatedDevice::path(double time_s) const noexcept {
  PathPoint at = evaluate(spec_.path, time_s, spec_.profile);
  if (!resumed_) return at;
  at.offset.position += resumed_->position;
  at.offset.orientation = at.offset.orientation * resumed_->orientation;
  return at;
}

void EmulatedDevice::resume_at(double time_s) noexcept {
  time_s_ = std::max(0.0, time_s);
  ticks_ = static_cast<std::uint64_t>(time_s_ * spec_.rate_hz + kSameTime);
  resumed_.reset();
  const Pose on_path = path(time_s_).offset;
  resumed_ = Pose{handle_.position - on_path.position, on_path.orientation.conjugate() * handle_.orientation};
  read_sensors();
}

void EmulatedDevice::take(const DeviceCommand& received) noexcept {
  held_ = received;
  const bool sound =
      received.wrench.force.allFinite() && received.wrench.torque.allFinite() &&
      finite({received.pose.position, received.pose.orientation, received.linear_velocity, received.angular_velocity});
  if (!sound) {
    held_.wrench = {};
    held_.pose = {handle_.position, handle_.orientation};
    held_.linear_velocity = held_.angular_velocity = Vec3::Zero();
  }
  // Limits of the motors.
  held_.wrench = {shortened(held_.wrench.force, spec_.force_limit_n),
                  shortened(held_.wrench.torque, spec_.torque_limit_n_m)};
}

void EmulatedDevice::step(const DeviceCommand& command, double dt) noexcept {
  const double period_s = 1.0 / spec_.rate_hz;
  const double end_s = time_s_ + dt;
  if (std::exchange(command_due_, false)) take(command);
  while (end_s - time_s_ > kSameTime * dt) {
    const double tick_s = static_cast<double>(ticks_ + 1) * period_s;
    const bool ticks = tick_s < end_s + kSameTime * period_s;
    move(std::max(0.0, std::min(tick_s, end_s) - time_s_));
    if (!ticks) continue;
    ++ticks_;
    read_sensors();
    const bool later = end_s - time_s_ <= kSameTime * dt;
    command_due_ = later;
    if (!later) take(command);
  }
  time_s_ = end_s;
}

void EmulatedDevice::move(double dt) noexcept {
  if (!spec_.operator_model && spec_.kind == DeviceKind::impedance) {
    time_s_ += dt;
    const PathPoint at = path(time_s_);
    handle_ = {at.offset.position, at.offset.orientation, at.linear_velocity, at.angular_velocity};
    return;
  }
  const int substeps = std::max(1, static_cast<int>(std::ceil(dt / kLongestSubstep_s - kSameTime)));
  for (int i = 0; i < substeps; ++i) {
    if (spec_.kind == DeviceKind::impedance) {
      step_operator(dt / substeps);
      if (spec_.degrees_of_freedom == 6) turn_operator(dt / substeps);
    } else {
      follow_command(dt / substeps);
    }
    time_s_ += dt / substeps;
  }
}

const EmulatedDevice::Motion& EmulatedDevice::motion(double dt) noexcept {
  if (std::abs(dt - motion_dt_) <= kSameTime * dt) return motion_;
  const double mass = operator_.mass_kg + spec_.mass_kg;
  Motion rate = Motion::Zero();
  rate(0, 1) = 1.0;
  rate(1, 0) = -operator_.stiffness_n_m / mass;
  rate(1, 1) = -(operator_.damping_n_s_m + spec_.damping_n_s_m) / mass;
  rate(1, 2) = operator_.stiffness_n_m / mass;
  rate(1, 3) = operator_.damping_n_s_m / mass;
  rate(1, 4) = 1.0;
  rate(2, 3) = 1.0;
  motion_ = Motion(rate * dt).exp();
  motion_dt_ = dt;
  return motion_;
}

void EmulatedDevice::step_operator(double dt) noexcept {
  const Motion& m = motion(dt);
  const double mass = operator_.mass_kg + spec_.mass_kg;
  const PathPoint wish = path(time_s_);
  const Vec3 way = handle_.position - wish.offset.position;
  const Vec3 push = (held_.wrench.force + tremor(time_s_ + 0.5 * dt)) / mass;
  const auto after = [&](int row) -> Vec3 {
    return m(row, 0) * way + m(row, 1) * handle_.linear_velocity + m(row, 3) * wish.linear_velocity + m(row, 4) * push;
  };
  Vec3 velocity = after(1);
  Vec3 position = wish.offset.position + after(0);
  // Coulomb friction, at most the force that stops the motion.
  if (const double speed = velocity.norm(); spec_.friction_n > 0.0 && speed > 0.0) {
    const Vec3 friction = -std::min(spec_.friction_n / mass, speed / m(1, 4)) / speed * velocity;
    velocity += m(1, 4) * friction;
    position += m(0, 4) * friction;
  }
  handle_.linear_velocity = velocity;
  handle_.position = position;
}

void EmulatedDevice::turn_operator(double dt) noexcept {
  const PathPoint wish = path(time_s_ + dt);
  const Vec3 twist =
      operator_.rotational_stiffness_n_m * rotation_vector(wish.offset.orientation * handle_.orientation.conjugate()) +
      operator_.rotational_damping_n_m_s * wish.angular_velocity + held_.wrench.torque;
  handle_.angular_velocity = (operator_.inertia_kg_m2 * handle_.angular_velocity + dt * twist) /
                             (operator_.inertia_kg_m2 + dt * operator_.rotational_damping_n_m_s);
  handle_.orientation = rotated(handle_.orientation, handle_.angular_velocity, dt);
}

void EmulatedDevice::follow_command(double dt) noexcept {
  // A critically damped servo towards the commanded pose, with the commanded velocity fed forward, on drives that go no
  // faster than the speed limit.
  const double w = kServoRate_rad_s;
  const Vec3 a =
      w * w * (held_.pose.position - handle_.position) + 2.0 * w * (held_.linear_velocity - handle_.linear_velocity);
  handle_.linear_velocity = shortened(handle_.linear_velocity + dt * a, spec_.speed_limit_m_s);
  handle_.position += dt * handle_.linear_velocity;
  if (spec_.degrees_of_freedom != 6) return;
  const Vec3 b = w * w * rotation_vector(held_.pose.orientation * handle_.orientation.conjugate()) +
                 2.0 * w * (held_.angular_velocity - handle_.angular_velocity);
  handle_.angular_velocity += dt * b;
  handle_.orientation = rotated(handle_.orientation, handle_.angular_velocity, dt);
}

void EmulatedDevice::press() noexcept {
  const PathPoint wish = path(time_s_);
  state_.applied.force =
      shortened(operator_.stiffness_n_m * (wish.offset.position - handle_.position) +
                    operator_.damping_n_s_m * (wish.linear_velocity - handle_.linear_velocity) + tremor(time_s_),
                spec_.force_limit_n);
  if (spec_.degrees_of_freedom != 6) return;
  state_.applied.torque = shortened(
      operator_.rotational_stiffness_n_m * rotation_vector(wish.offset.orientation * handle_.orientation.conjugate()) +
          operator_.rotational_damping_n_m_s * (wish.angular_velocity - handle_.angular_velocity),
      spec_.torque_limit_n_m);
}

void EmulatedDevice::read_sensors() noexcept {
  if (ticks_ > 0) ++state_.sequence;
  if (spec_.kind == DeviceKind::admittance) press();
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
