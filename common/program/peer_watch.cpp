#include "program/peer_watch.hpp"

namespace subworld {

std::string PeerWatch::fault(const StatusBeacon& status) const {
  if (!gone()) return {};
  return foreign_ ? replaced_text(peer_.program, peer_.instance) : status.gone_text(peer_.program, peer_.instance);
}

}  // namespace subworld
