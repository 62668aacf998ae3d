#pragma once

#include <string>

namespace subworld {

/// Each user's frames and reports, and each device's states and commands, have their own partition.
inline std::string user_partition(int user) { return "user_" + std::to_string(user); }
inline std::string device_partition(int device) { return "device_" + std::to_string(device); }

}  // namespace subworld
