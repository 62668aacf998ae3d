#pragma once

#include "wire/backend.hpp"
#include "wire/bus.hpp"

#include <array>
#include <optional>

/// Start-up work of the bus that needs no vendor.
namespace subworld::wire {

/// A variable of the environment by which the programs of a vendor, or of ROS, choose discovery or transports.
struct VendorVariable {
  const char* name;
  std::optional<Vendor> settings_of = {};  ///< names the settings of this vendor; none: Subworld ignores the variable
};
inline constexpr std::array kVendorVariables{VendorVariable{"FASTRTPS_DEFAULT_PROFILES_FILE", Vendor::fastdds},
                                             VendorVariable{"CYCLONEDDS_URI", Vendor::cyclonedds},
                                             VendorVariable{"ROS_DISCOVERY_SERVER"},
                                             VendorVariable{"ROS_SUPER_CLIENT"},
                                             VendorVariable{"ROS_LOCALHOST_ONLY"},
                                             VendorVariable{"ROS_AUTOMATIC_DISCOVERY_RANGE"},
                                             VendorVariable{"ROS_STATIC_PEERS"},
                                             VendorVariable{"FASTDDS_DEFAULT_PROFILES_FILE"},
                                             VendorVariable{"FASTDDS_ENVIRONMENT_FILE"},
                                             VendorVariable{"FASTDDS_BUILTIN_TRANSPORTS"},
                                             VendorVariable{"FASTDDS_STATISTICS"}};

/// Removes those that Subworld ignores from the environment of this process, so that the vendors ignore them too.
/// Returns the names of those that were set.
std::vector<std::string> ignore_variables();

/// Checks domain, interface and peers, resolves host names and finds the settings file. Throws `Error` (middleware).
[[nodiscard]] Opening prepare(const BusConfig& config);

/// Keys of a program in a folder that `subworld keys make` wrote; those of all commands of `subworld` are the same.
/// Throws `Error` (middleware) where a file is missing.
[[nodiscard]] Keys keys_of(const std::string& folder, std::string_view program);

/// Loads the vendor's plug-in from $SUBWORLD_PLUGIN_DIR or from the program's folder. Throws `Error` (middleware) that
/// names the missing file and its package.
[[nodiscard]] OpenBackend load_plugin(Vendor vendor);

/// The version of a vendor whose plug-in can be loaded; empty: it cannot.
[[nodiscard]] std::string installed_version(Vendor vendor);

}  // namespace subworld::wire
