#pragma once

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {

/// Network settings of a program.
struct Network {
  std::string dds = "fastdds";  ///< vendor: fastdds or cyclonedds
  int domain = 0;               ///< 0 .. 232
  /// Hosts of the other programs; empty: this host, or the hosts of the vendor's settings.
  std::vector<std::string> peers;
  int host_users = 0;             ///< users whose programs run on one host, at most; 0: any
  std::string interface_address;  ///< empty: as in the settings, else loopback
  std::string qos_file;           ///< the vendor's settings; empty: its environment variable, else its default
  std::string secure;             ///< folder of `subworld keys make`; empty: no security
};

/// Participants for which a DDS domain has room on one host, for any vendor. Participant i has the UDP ports
/// 7410 + 250 domain + 2 i and the next one (RTPS 9.6.1.1). They must lie below those of the next domain, and below
/// 65536.
[[nodiscard]] constexpr int participant_room(int domain) noexcept {
  constexpr int kOfDomain = 120, kPorts = 65536;
  return std::min(kOfDomain, (kPorts - 7410 - 250 * domain) / 2);
}
/// Participants of a run of so many users: the world, the launcher, a display, two of `subworld control`, and a
/// haptic_sim and a device_sim for each user.
[[nodiscard]] constexpr int participants_of(int users) noexcept { return 5 + 2 * users; }
/// Users for whom one host has room.
[[nodiscard]] constexpr int user_room(int domain) noexcept {
  return (participant_room(domain) - participants_of(0)) / 2;
}

/// Whether the name or address of a host is another one than this: all but loopback.
[[nodiscard]] inline bool is_remote(const std::string& host) {
  return host != "localhost" && !host.starts_with("127.");
}

}  // namespace subworld
