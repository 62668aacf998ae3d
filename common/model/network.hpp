#pragma once

#include <string>
#include <vector>

namespace subworld {

/// How a program finds the others. Discovery is unicast, to the peers and this host.
struct Network {
  std::string dds = "fastdds";     ///< vendor: fastdds or cyclonedds
  int domain = 0;                  ///< 0 .. 232
  std::vector<std::string> peers;  ///< other hosts of the run; empty: none, or as the vendor's settings say
  std::string interface_address;   ///< empty: as the settings say, else loopback
  std::string qos_file;            ///< the vendor's settings; empty: its environment variable, else its default
};

/// Whether the name or address of a host is another one than this: all but loopback.
[[nodiscard]] inline bool is_remote(const std::string& host) {
  return host != "localhost" && !host.starts_with("127.");
}

}  // namespace subworld
