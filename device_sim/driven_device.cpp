#include "device_sim/driven_device.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kSilent_s = 0.01;
constexpr double kSilentPeriods = 5.0;
constexpr double kMargin_s = 0.1;                             ///< haptic_sim has noticed an absence by then
constexpr double kVelocityFilter_rad_s = 2.0 * M_PI * 100.0;  ///< of a velocity from two positions

Vec3 to_vector(const std::array<double, 3>& v) noexcept { return {v[0], v[1], v[2]}; }
Quat to_quaternion(const std::array<double, 4>& q) noexcept { return Quat(q[0], q[1], q[2], q[3]).normalized(); }
std::array<double, 3> to_array(const Vec3& v) noexcept { return {v.x(), v.y(), v.z()}; }

}  // namespace

DeviceSpec within_limits(DeviceSpec spec, const DriverCapabilities& capabilities, std::string_view name) {
  if (spec.kind != DeviceKind::impedance) {
    throw Error(ExitCode::usage, fmt::format("--device {}: drivers serve impedance devices; set device.kind: impedance "
                                             "in the scene, or use --device emulated",
                                             name));
  }
  if (spec.degrees_of_freedom > capabilities.degrees_of_freedom) {
    throw Error(ExitCode::usage, fmt::format("--device {}: has {} degrees of freedom, the scene's device {}; set "
                                             "device.degrees_of_freedom: 3",
                                             name, capabilities.degrees_of_freedom, spec.degrees_of_freedom));
  }
  if (capabilities.force_limit_n <= 0.0) return spec;  // none is shown: the scene's limits are of no effect
  const auto rate_n_s = spec.force_rate_limit_n_s.value_or(spec.force_limit_n / DeviceSpec::kFullScale_s);
  const auto power_w = spec.power_limit_w.value_or(spec.force_limit_n * DeviceSpec::kFastestPush_m_s);
  spec.force_limit_n = std::min(spec.force_limit_n, capabilities.force_limit_n);
  spec.torque_limit_n_m = std::min(spec.torque_limit_n_m, capabilities.torque_limit_n_m);
  spec.force_rate_limit_n_s = std::min(rate_n_s, spec.force_limit_n / DeviceSpec::kFullScale_s);
  spec.power_limit_w = std::min(power_w, spec.force_limit_n * DeviceSpec::kFastestPush_m_s);
  return spec;
}

DrivenDevice::DrivenDevice(const DriverPlugin& plugin, const DeviceUse& use, const DeviceSpec& spec,
                           std::uint32_t device)
    : name_(plugin.name), use_(use), driver_(plugin, use.settings, static_cast<int>(device), use.domain) {
  const TimePoint begin = Clock::now();
  std::string fault = "it has not opened";
  ReadingFault refused = ReadingFault::none;
  while (seen_ == 0 || refused != ReadingFault::none) {
    if (to_seconds(Clock::now() - begin) > use.wait_s) {
      throw Error(ExitCode::failed,
                  fmt::format("device {}: no good reading within {} s: {}; `subworld device check {}` "
                              "examines the driver",
                              name_, use.wait_s, fault, name_));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const DriverThread::Report report = driver_.report();
    reports_ = report.number;
    if (report.phase == DriverThread::Phase::refused) {
      throw Error(ExitCode::usage, fmt::format("--device-settings of the device {}: {}; it takes: {}", name_,
                                               report.text.data(), plugin.settings));
    }
    if (report.phase != DriverThread::Phase::open) {
      if (report.phase == DriverThread::Phase::lost) fault = report.text.data();
      continue;
    }
    capabilities_ = report.capabilities;
    const DriverThread::Sample sample = driver_.newest();
    if (sample.number == seen_) {
      if (seen_ == 0) fault = "it is open, and reads nothing";
      continue;
    }
    seen_ = sample.number;
    refused = judge(sample.reading, nullptr, capabilities_);
    fault = kReadingFaults[static_cast<std::size_t>(refused)];
    first_ = last_ = sample.reading;
  }
  silent_s_ = std::max(kSilent_s, kSilentPeriods / std::min(capabilities_.rate_hz, spec.rate_hz));
  const double stale_s = std::max(0.005, 5.0 / spec.rate_hz) + kLongestAbsence_s;  // as haptic_sim judges a device
  shortest_absence_s_ = std::max(kAbsent_s, 2.0 * stale_s) + kMargin_s;
  state_.device = device;
  result_.name = name_;
  result_.version = plugin.version;
  result_.readings = 1;
}

Pose DrivenDevice::pose_of(const DriverReading& reading) const noexcept {
  const Vec3 way = use_.scale_ratio * (to_vector(reading.position_m) - to_vector(first_.position_m));
  if (capabilities_.degrees_of_freedom != 6) return {base_.position + way, base_.orientation};
  const Quat turn = to_quaternion(reading.orientation) * to_quaternion(first_.orientation).conjugate();
  return {base_.position + way, Quat((turn * base_.orientation).normalized())};
}

void DrivenDevice::use(const DriverReading& reading) noexcept {
  const int button = use_.declutch_button;
  const bool pressed = button >= 0 && (reading.buttons >> static_cast<unsigned>(button) & 1U) != 0;
  state_.buttons = reading.buttons;
  if (pressed || declutched_) {
    declutched_ = pressed;
    first_ = reading;
    base_ = state_.pose;
    state_.linear_velocity = state_.angular_velocity = Vec3::Zero();
    return;
  }
  const auto [position, orientation] = pose_of(reading);
  const double passed_s = reading.time_s - last_.time_s;
  if (capabilities_.measures_velocity) {
    state_.linear_velocity = use_.scale_ratio * to_vector(reading.linear_velocity_m_s);
    state_.angular_velocity = to_vector(reading.angular_velocity_rad_s);
  } else if (passed_s > 0.0 && quiet_s_ <= silent_s_) {
    const double part = 1.0 - std::exp(-kVelocityFilter_rad_s * passed_s);
    const Eigen::AngleAxisd turned(orientation * state_.pose.orientation.conjugate());
    const double angle = std::remainder(turned.angle(), 2.0 * M_PI);
    state_.linear_velocity += part * ((position - state_.pose.position) / passed_s - state_.linear_velocity);
    state_.angular_velocity += part * (angle / passed_s * turned.axis() - state_.angular_velocity);
  }
  state_.pose = {position, orientation};
}

void DrivenDevice::observe(double dt) noexcept {
  quiet_s_ += dt;
  const DriverThread::Report report = driver_.report();
  const bool lost = report.phase != DriverThread::Phase::open;
  const bool comparable = quiet_s_ <= silent_s_ && report.number == reports_;
  if (const DriverThread::Sample sample = driver_.newest(); !lost && sample.number != seen_) {
    seen_ = sample.number;
    const ReadingFault fault = judge(sample.reading, comparable ? &last_ : nullptr, capabilities_);
    ++refused_[static_cast<std::size_t>(fault)];
    if (fault == ReadingFault::none) {
      ++result_.readings;
      use(sample.reading);
      result_.longest_gap_s = std::max(result_.longest_gap_s, quiet_s_);
      quiet_s_ = 0.0;
      last_ = sample.reading;
    }
  }
  const bool silent = lost || report.number != reports_ || quiet_s_ > silent_s_;
  if (present_ && silent) {
    present_ = false;
    absent_s_ = 0.0;
    state_.linear_velocity = state_.angular_velocity = Vec3::Zero();
    ++result_.absences;
    const char* why = report.text.data();
    news_ =
        lost ? fmt::format("device {} is lost: {}; the force has faded", name_, why)
             : fmt::format("device {} has no good reading for {:.0f} ms; the force has faded", name_, 1e3 * silent_s_);
  }
  if (report.phase == DriverThread::Phase::open) reports_ = report.number;
  if (present_) return;
  absent_s_ += dt;
  result_.absent_s += dt;
  if (silent || absent_s_ < shortest_absence_s_) return;
  present_ = true;
  news_ = fmt::format("device {} is there again after {:.1f} s; the force rises from zero", name_, absent_s_);
}

void DrivenDevice::step(const DeviceCommand& command, double dt) noexcept {
  driver_.write({to_array(command.wrench.force), to_array(command.wrench.torque)});
  state_.stamp_s += dt;
  ++state_.sequence;
  observe(dt);
}

void DrivenDevice::idle(double dt) noexcept {
  driver_.write({});
  ++state_.sequence;
  observe(dt);
}

std::string DrivenDevice::news() { return std::exchange(news_, {}); }

DriverResult DrivenDevice::result() const {
  DriverResult result = result_;
  std::vector<std::string> reasons;
  for (std::size_t fault = 1; fault < refused_.size(); ++fault) {
    if (refused_[fault] == 0) continue;
    result.refused += refused_[fault];
    reasons.push_back(fmt::format("{} {}", refused_[fault], kReadingFaults[fault]));
  }
  result.refused_for = joined(reasons, ", ");
  return result;
}

}  // namespace subworld
