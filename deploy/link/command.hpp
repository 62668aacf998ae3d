#pragma once

#include "io/command_line.hpp"

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

/// What `subworld link` is to do.
struct LinkRequest {
  static constexpr int kMostHosts = 8;

  std::vector<std::string> words;  ///< of both directions
  std::string a_to_b, b_to_a;      ///< take the place of `words` where given
  int hosts = 2;
  std::string backend = "auto";
  int mtu = 1500;
  std::uint64_t seed = 1;
  std::array<std::string, kMostHosts> commands;  ///< for each host; empty: none
  double duration_s = 0.0;                       ///< 0: until a signal, or until the commands have ended
  double validate_s = 0.0;                       ///< 0: no validation
};

void add_link_options(CommandLine& line, LinkRequest& request);

/// Makes the hosts and the link, and runs what is requested. Returns the exit code. Throws `Error`.
[[nodiscard]] int run_link(const LinkRequest& request);

}  // namespace subworld
