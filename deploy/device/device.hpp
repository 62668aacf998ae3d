#pragma once

#include "device_sim/driver_check.hpp"

#include <string>

namespace subworld {

/// `subworld device list`: prints the drivers that are found, with their settings.
void list_devices();

/// `subworld device check NAME`: prints a verdict for each property of a driver. Returns the exit code. Throws `Error`
/// (usage).
[[nodiscard]] int check_device(const std::string& name, const DriverCheckRequest& request);

}  // namespace subworld
