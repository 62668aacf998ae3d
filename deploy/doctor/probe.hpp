#pragma once

#include "doctor/facts.hpp"

#include <string>

namespace subworld::doctor {

/// Own address from which the kernel would send to this one; empty: there is no route.
[[nodiscard]] std::string source_address(const std::string& to);

/// Sends to a host, from that interface: an echo request, one as long as the interface's MTU, a request for its time,
/// and a datagram to an unused UDP port. Waits at most half a second for the answers. Without the right to send echo
/// requests, the datagram alone counts, and the size is not examined.
void probe(Peer& peer, const Interface& from, int unused_port);

}  // namespace subworld::doctor
