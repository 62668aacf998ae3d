#pragma once

#include "doctor/facts.hpp"

#include <string>

namespace subworld::doctor {

/// Own address from which the kernel would send to this one; empty: there is no route.
[[nodiscard]] std::string source_address(const std::string& to);

/// Sends to a host, from that interface: an echo request, one as long as the interface's MTU, a request for its time,
/// and datagrams to an unused UDP port of the domain. Listens at most 1.2 s for the answers: a host answers for closed
/// ports about once a second. Any port of the domain counts. Needs the right to use raw sockets: without it nothing is
/// known.
void probe(Peer& peer, const Interface& from, int domain);

}  // namespace subworld::doctor
