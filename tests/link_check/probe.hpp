#pragma once

#include "link/network.hpp"
#include "link_check/statistics.hpp"

namespace subworld {

/// Packets that a host sends to another one at a steady rate, over UDP.
struct ProbePlan {
  LinkEnds ends;
  double rate_hz = 1000.0;
  double duration_s = 5.0;
  int bytes = 64;  ///< of an IP packet, at least 44
};

struct Probed {
  std::vector<ProbeArrival> arrivals;  ///< in the order of arrival
  std::uint64_t sent = 0;
  double first_s = 0.0;  ///< arrival of the first packet and the last one, s since the start of the probe
  double last_s = 0.0;
};

/// Runs all plans at the same time, and waits `rest_s` for packets that are still on their way. A delay is the time
/// from before the system call that sends until the receiver's kernel has the packet. Throws `Error` (failed).
[[nodiscard]] std::vector<Probed> probe(const EmulatedNetwork& network, const std::vector<ProbePlan>& plans,
                                        double rest_s);

}  // namespace subworld
