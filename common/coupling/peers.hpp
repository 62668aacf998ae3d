#pragma once

#include "coupling/contact_graph.hpp"
#include "model/scene.hpp"

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

namespace subworld {

/// A body that another user's proxy touches, or may touch before the sub-world hears of it.
struct PeerContact {
  BodyId body{};
  BodyId proxy{};
};

/// Finds the other users whom a user may feel: those whose proxies contacts connect to the user's own proxy, at any
/// distance, but not through fixed bodies. A contact that a proxy may make before the sub-world hears of it counts as
/// one: else the first contact would be felt late. Where there is such a peer, the whole island of the user's proxy may
/// belong to the sub-world, if it is small enough, so that it can be closed; else the shortest chain to the peer.
class PeerFinder {
 public:
  explicit PeerFinder(const Scene& scene);

  /// The bodies that a proxy may reach before the sub-world hears of it; the proxy itself may be among them.
  using Reachable = std::function<void(BodyId proxy, std::vector<BodyId>& out)>;

  /// Whether so many bodies with so many contacts are small enough.
  using Fits = std::function<bool(std::size_t bodies, std::size_t contacts)>;

  /// Adds to `bodies`, which stays ascending, each such peer and the island, or the chains; nothing where there is no
  /// peer. Returns the last link of the shortest chain to each.
  std::span<const PeerContact> find(BodyId proxy, std::span<const BodyId> peers, const ContactGraph& graph,
                                    const Reachable& reachable, const Fits& fits, std::vector<BodyId>& bodies);

 private:
  void visit(BodyId id, BodyId from);

  const Scene& scene_;
  std::vector<BodyId> from_;         ///< by body: the one from which it was visited; itself: not visited
  std::vector<BodyId> visited_;      ///< in their order
  std::vector<BodyId> near_;         ///< what a proxy may reach
  std::vector<PeerContact> coming_;  ///< contacts that peers may make
  std::vector<PeerContact> links_;
};

}  // namespace subworld
