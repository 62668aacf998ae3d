#pragma once

#include <string>
#include <vector>

namespace subworld {

/// How a program finds the others.
struct Network {
  std::string dds = "fastdds";     ///< vendor: fastdds or cyclonedds
  int domain = 0;                  ///< 0 .. 232
  std::vector<std::string> peers;  ///< hosts of the other programs; empty: this host, or as the vendor's settings say
  std::string interface_address;   ///< empty: as the settings say, else loopback
  std::string qos_file;            ///< the vendor's settings; empty: its environment variable, else its default
};

}  // namespace subworld
