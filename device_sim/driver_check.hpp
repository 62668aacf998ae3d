#pragma once

#include "device_sim/driver.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

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

/// A property that a driver must have, and whether it has it.
struct DriverProperty {
  std::string name;
  bool held = false;
  std::string found;  ///< what was measured or happened
};

struct DriverCheckRequest {
  std::string settings;
  int user = 0;
  double duration_s = 3.0;  ///< of the readings; the operator moves the device meanwhile
};

/// Opens the driver, reads it as `device_sim` does with a zero wrench, closes it and opens it again. Properties that
/// could not be examined are not listed; the one that prevented it is not held. A driver that does not return is
/// abandoned.
[[nodiscard]] std::vector<DriverProperty> check_driver(const DriverPlugin& plugin, const DriverCheckRequest& request);

}  // namespace subworld
