#include "device_sim/reading_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kUnit = 1e-3;          ///< largest deviation of a quaternion's length from 1
constexpr double kBeyond = 1.5;         ///< times the workspace, that a position may be away from 0
constexpr double kFastest_rad = 100.0;  ///< angular speed, rad/s

template <std::size_t N>
bool finite(const std::array<double, N>& values) noexcept {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

bool within(double value, double least, double most) noexcept { return value >= least && value <= most; }

}  // namespace

ReadingFault judge(const DriverReading& reading, const DriverReading* before,
                   const DriverCapabilities& capabilities) noexcept {
  if (!std::isfinite(reading.time_s) || !finite(reading.position_m) || !finite(reading.orientation) ||
      !finite(reading.linear_velocity_m_s) || !finite(reading.angular_velocity_rad_s))
    return ReadingFault::not_finite;
  const auto& q = reading.orientation;
  if (std::abs(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) - 1.0) > kUnit)
    return ReadingFault::orientation;
  for (const double coordinate : reading.position_m) {
    if (std::abs(coordinate) > kBeyond * capabilities.workspace_m) return ReadingFault::workspace;
  }
  if (capabilities.measures_velocity && (length_of(reading.linear_velocity_m_s) > kFastestReading_m_s ||
                                         length_of(reading.angular_velocity_rad_s) > kFastest_rad))
    return ReadingFault::jump;
  if (before == nullptr) return ReadingFault::none;
  const double passed_s = reading.time_s - before->time_s;
  if (passed_s < 0.0) return ReadingFault::time;
  const std::array<double, 3> way{reading.position_m[0] - before->position_m[0],
                                  reading.position_m[1] - before->position_m[1],
                                  reading.position_m[2] - before->position_m[2]};
  const double least_s = 1.0 / capabilities.rate_hz;
  return length_of(way) > kFastestReading_m_s * std::max(passed_s, least_s) ? ReadingFault::jump : ReadingFault::none;
}

std::string fault_of(const DriverCapabilities& capabilities) {
  const auto& c = capabilities;
  if (c.degrees_of_freedom != 3 && c.degrees_of_freedom != 6)
    return fmt::format("degrees_of_freedom is {}; it must be 3 or 6", c.degrees_of_freedom);
  if (!within(c.workspace_m, 1e-3, 10.0))
    return fmt::format("workspace_m is {}; it must be from 0.001 to 10 m", c.workspace_m);
  if (!within(c.force_limit_n, 0.0, 1e3))
    return fmt::format("force_limit_n is {}; it must be from 0 to 1000 N", c.force_limit_n);
  if (!within(c.torque_limit_n_m, 0.0, 100.0))
    return fmt::format("torque_limit_n_m is {}; it must be from 0 to 100 N m", c.torque_limit_n_m);
  if (!within(c.rate_hz, 10.0, 1e5)) return fmt::format("rate_hz is {}; it must be from 10 to 100000 Hz", c.rate_hz);
  return {};
}

}  // namespace subworld
