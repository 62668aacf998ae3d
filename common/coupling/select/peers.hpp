#pragma once

#include "coupling/select/contact_graph.hpp"
#include "model/disjoint_sets.hpp"
#include "model/scene/scene.hpp"

#include <cstddef>
#include <cstdint>
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
///
/// For each stamp: `begin`, then `find` for each user. A user whose island holds no other proxy costs a look-up.
class PeerFinder {
 public:
  explicit PeerFinder(const Scene& scene);

  /// The bodies that a proxy may reach before the sub-world hears of it; the proxy itself may be among them.
  using Reachable = std::function<void(BodyId proxy, std::vector<BodyId>& out)>;

  /// Whether so many bodies with so many contacts are small enough.
  using Fits = std::function<bool(std::size_t bodies, std::size_t contacts)>;

  /// `contacts` are all of the world's, `proxies` those of all users, in their order.
  void begin(std::span<const Contact> contacts, std::span<const BodyId> proxies, const Reachable& reachable);
  /// `reachable` names no more than it did in `begin`. Adds to `bodies`, which stays ascending, each such peer and the
  /// island, or the chains; nothing where there is no peer. Returns the last link of the shortest chain to each.
  std::span<const PeerContact> find(BodyId proxy, const ContactGraph& graph, const Reachable& reachable,
                                    const Fits& fits, std::vector<BodyId>& bodies);

 private:
  /// A contact that a peer may make with a body, and the next one with the same body.
  struct Coming {
    BodyId body{};
    BodyId proxy{};
    std::uint32_t next = 0;
  };
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;

  [[nodiscard]] bool fixed(BodyId id) const noexcept { return fixed_[index(id)] != 0; }
  void join(BodyId a, BodyId b) noexcept;
  void list_coming(BodyId proxy, const Reachable& reachable);
  void visit(BodyId id, BodyId from);

  std::vector<std::uint8_t> fixed_;     ///< by body
  std::vector<std::uint8_t> is_proxy_;  ///< by body
  std::vector<BodyId> proxies_;
  DisjointSets sets_;                          ///< of bodies that are connected, or may soon be
  std::vector<std::uint32_t> proxies_of_set_;  ///< by root
  std::vector<BodyId> from_;                   ///< by body: the one from which it was visited; itself: not visited
  std::vector<BodyId> visited_;                ///< in their order
  std::vector<BodyId> near_;                   ///< what a proxy may reach
  std::vector<Coming> coming_;
  std::vector<std::uint32_t> first_coming_;  ///< by body: index of the first, by the order of the peers
  std::vector<PeerContact> links_;
};

}  // namespace subworld
