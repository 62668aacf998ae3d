#pragma once

#include "model/settings/network.hpp"

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// A program of Subworld that runs on this machine, in the network namespace of this process.
struct RunningProgram {
  pid_t pid = 0;
  std::string name = {};                ///< world_sim, haptic_sim, device_sim or gui_headless
  std::vector<std::string> words = {};  ///< its command line
  int domain = 0;                       ///< of --domain, else SUBWORLD_DOMAIN, else 0
  int user = 0;                         ///< of --user
  Network network = {};                 ///< of its command line and its SUBWORLD_DDS
  bool suspended = false;               ///< by SIGSTOP, or Ctrl-Z in its terminal
  std::string file = {};                ///< its executable; empty where it cannot be read
  bool file_replaced = false;           ///< the executable was deleted or replaced since it started
  double age_s = 0.0;                   ///< time since it started
};

/// The oldest first. Reads /proc.
[[nodiscard]] std::vector<RunningProgram> running_programs();

/// "haptic_sim 0", "world_sim"
[[nodiscard]] std::string label_of(const RunningProgram& program);

/// The value of an option in a command line, as `--name value` or `--name=value`; the last one counts.
[[nodiscard]] std::optional<std::string> value_of(const std::vector<std::string>& words, const std::string& option);

/// A DDS domain that a run on this machine has claimed.
struct ClaimedDomain {
  int domain = 0;
  pid_t pid = 0;  ///< of its launcher; 0 where it cannot be seen
};

/// In ascending order, of this network namespace. Binds no port, so that it disturbs no start.
[[nodiscard]] std::vector<ClaimedDomain> claimed_domains();

/// A UDP port of this network namespace that a socket is bound to.
struct BoundPort {
  int port = 0;
  uid_t user = 0;  ///< of the socket
  std::uint64_t inode = 0;
};
[[nodiscard]] std::vector<BoundPort> bound_udp_ports();

/// The program that has this socket: its id and name; none where it cannot be seen.
[[nodiscard]] std::optional<std::pair<pid_t, std::string>> owner_of_socket(std::uint64_t inode);

/// "subworld (process 123)"; or "a program of user root", where the process cannot be seen.
[[nodiscard]] std::string owner_text(const BoundPort& bound);

/// Files that running processes map or have open, of those that this process may see.
[[nodiscard]] std::set<std::string> files_in_use(const std::string& folder);

/// A whole file of /proc or another text file; empty where it cannot be read.
[[nodiscard]] std::string file_text(const std::string& file);

/// First UDP port of a domain (RTPS 9.6.1.1); its ports end before those of the next domain.
[[nodiscard]] constexpr int first_port(int domain) noexcept { return 7400 + 250 * domain; }
inline constexpr int kPortsOfDomain = 250;
/// The port that a run binds, to have the domain alone. No vendor uses it: participants begin with the next one, and
/// multicast has the first two.
[[nodiscard]] constexpr int claim_port(int domain) noexcept { return first_port(domain) + 9; }

/// Whether a socket is bound to a port of the domain.
[[nodiscard]] bool uses_domain(const std::vector<BoundPort>& ports, int domain);

}  // namespace subworld
