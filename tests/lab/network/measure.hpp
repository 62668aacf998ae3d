#pragma once

#include "lab/network/peer.hpp"
#include "link/network.hpp"

#include <functional>
#include <memory>
#include <string>

namespace subworld {

struct NetworkRunSettings {
  double duration_s = 10.0;  ///< that counts, of each cell
  int domain = 90;           ///< that no other program of this host uses
  std::uint64_t seed = 1;    ///< of the emulated link
};

/// What a cell has shown, over all its users.
struct CellFindings {
  std::string failure = {};   ///< why the cell could not be measured; empty: it was
  std::uint64_t planned = 0;  ///< messages from the world, to all users
  std::uint64_t sent = 0;
  std::uint64_t refused = 0;
  Arrivals there = {};
  Arrivals round_trip = {};
  Histogram back = {};
  std::uint64_t deadline_missed = 0;
  std::uint64_t liveliness_lost = 0;
  double world_cpu_ratio = 0.0;    ///< s per s
  double haptic_cpu_ratio = 0.0;   ///< mean of the users
  double link_cpu_ratio = 0.0;     ///< of the emulator
  std::uint64_t link_packets = 0;  ///< in both directions while measuring; 0: no link
  double link_loss_ratio = 0.0;
  double link_delay_s = 0.0;  ///< mean
  std::string scheduling = {};
};

/// The world and the users of a cell, each on an emulated host, in this order; null on loopback. Throws `Error`
/// (failed).
[[nodiscard]] std::unique_ptr<EmulatedNetwork> network_of(const NetworkCell& cell, std::uint64_t seed);

/// Runs a cell. Where its processes or its network cannot be made, the findings have the reason. A stop request ends
/// it: then its findings are incomplete.
[[nodiscard]] CellFindings measure_cell(const NetworkCell& cell, const NetworkRunSettings& settings);

/// Length of a cell without failures, s, for the estimate of the time left.
[[nodiscard]] double planned_s(const NetworkCell& cell, const NetworkRunSettings& settings);

}  // namespace subworld
