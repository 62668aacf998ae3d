#pragma once

#include "coupling/select/contact_graph.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

namespace subworld {

/// Who decides the state of a movable body that both the world and a sub-world hold.
enum class Owner : std::uint8_t {
  user,    ///< the body is the user's own proxy
  peer,    ///< the body is another user's proxy
  island,  ///< its island lies wholly inside this sub-world in both copies, and in no other sub-world
  world,   ///< any other
};

/// The one place that decides who owns a body. An island is a set of movable bodies that contacts connect. Each side
/// labels the islands of its own contacts and sends the labels; `compare` joins both, so that world and sub-world come
/// to the same answer without a second round trip.
class Authority {
 public:
  /// `peers` are the proxies of the other users.
  Authority(BodyId proxy, std::vector<BodyId> peers) : proxy_(proxy), peers_(std::move(peers)) {}

  /// Labels the islands of one side: for each of `members` (ascending) a number that its island alone has, or
  /// kOpenIsland where the island reaches out of the sub-world, or holds a body for which `shared` (may be empty) is
  /// true.
  static void label(const Scene& scene, Islands& islands, std::span<const BodyId> members,
                    std::span<const Contact> contacts, const std::function<bool(BodyId)>& shared,
                    std::vector<std::uint32_t>& labels);

  /// Takes both sides' labels of one stamp. A frame without labels says nothing of islands: none is closed.
  void compare(const WorldFrame& frame, const HapticReport& report);
  /// Whether the sub-world of a report holds another user's proxy.
  [[nodiscard]] bool has_peer(const HapticReport& report) const;
  /// After compare().
  [[nodiscard]] Owner owner(BodyId id);

  /// The share of one sub-world's correction of a body that `holders` sub-worlds hold: they count alike.
  [[nodiscard]] static double share(int holders) noexcept { return holders > 1 ? 1.0 / holders : 1.0; }

 private:
  BodyId proxy_;
  std::vector<BodyId> peers_;
  bool labelled_ = false;
  Islands islands_;
  std::vector<BodyId> reported_;
};

/// The proxies of the users other than `user`.
[[nodiscard]] std::vector<BodyId> peers_of(const Scene& scene, std::size_t user);

}  // namespace subworld
