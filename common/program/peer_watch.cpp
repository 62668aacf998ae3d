#include "program/peer_watch.hpp"

namespace subworld {

std::string PeerWatch::fault() const {
  if (!gone()) return {};
  return foreign_ ? replaced_text(peer_.program, peer_.instance) : gone_text(peer_.program, peer_.instance);
}

}  // namespace subworld
