#pragma once

#include "device_sim/driver.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// The device that needs no driver.
inline constexpr std::string_view kEmulated = "emulated";

/// Names of the drivers in the folders of SUBWORLD_DEVICES and in the program's folder.
[[nodiscard]] std::vector<std::string> driver_names();

/// Throws `Error` (usage) with the names that there are.
[[nodiscard]] const DriverPlugin& driver_plugin(std::string_view name);

/// Why a real device takes no part in lock-step, and the cure.
[[nodiscard]] std::string refused_in_lockstep(std::string_view name);

}  // namespace subworld
