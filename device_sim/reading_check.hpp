#pragma once

#include "device_sim/driver.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <string>

namespace subworld {

/// Why a reading is refused. Then it counts as not made.
enum class ReadingFault : std::uint8_t { none, not_finite, orientation, workspace, time, jump, count };
inline constexpr std::array<const char*, static_cast<std::size_t>(ReadingFault::count)> kReadingFaults{
    "none",
    "not finite",
    "orientation is no unit quaternion",
    "outside the workspace; are positions in metres?",
    "time ran backwards",
    "faster than 10 m/s"};

/// No operator is faster, m/s.
inline constexpr double kFastestReading_m_s = 10.0;

[[nodiscard]] inline double length_of(const std::array<double, 3>& v) noexcept { return std::hypot(v[0], v[1], v[2]); }

/// Judges a reading. `before`: the last good one; null if there is none with which it can be compared.
[[nodiscard]] ReadingFault judge(const DriverReading& reading, const DriverReading* before,
                                 const DriverCapabilities& capabilities) noexcept;

/// What is wrong with a driver's capabilities; empty: nothing.
[[nodiscard]] std::string fault_of(const DriverCapabilities& capabilities);

}  // namespace subworld
