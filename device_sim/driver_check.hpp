#pragma once

#include "device_sim/driver.hpp"

#include <string>
#include <vector>

namespace subworld {

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
