#pragma once

#include <string>
#include <vector>

namespace subworld {

/// Network settings of a program.
struct Network {
  std::string dds = "fastdds";  ///< vendor: fastdds or cyclonedds
  int domain = 0;               ///< 0 .. 232
  /// Hosts of the other programs; empty: this host, or the hosts of the vendor's settings.
  std::vector<std::string> peers;
  std::string interface_address;  ///< empty: as in the settings, else loopback
  std::string qos_file;           ///< the vendor's settings; empty: its environment variable, else its default
};

/// Whether the name or address of a host is another one than this: all but loopback.
[[nodiscard]] inline bool is_remote(const std::string& host) {
  return host != "localhost" && !host.starts_with("127.");
}

}  // namespace subworld
