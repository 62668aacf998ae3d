#include "coupling/sync/authority.hpp"

#include "model/sorted.hpp"

#include <algorithm>

namespace subworld {

void Authority::label(const Scene& scene, Islands& islands, std::span<const BodyId> members,
                      std::span<const Contact> contacts, const std::function<bool(BodyId)>& shared,
                      std::vector<std::uint32_t>& labels) {
  islands.begin(members);
  for (const Contact& c : contacts) {
    if (!scene.body(c.a).fixed() && !scene.body(c.b).fixed()) islands.join(c.a, c.b);
  }
  if (shared) {
    for (const BodyId id : members) {
      if (shared(id)) islands.open(id);
    }
  }
  islands.labels(labels);
}

void Authority::compare(const WorldFrame& frame, const HapticReport& report) {
  labelled_ = !frame.islands.empty();
  if (!labelled_) return;
  islands_.begin(frame.members);
  islands_.join(frame.members, frame.islands);
  for (const StampedBody& sub : report.members) reported_.push_back(sub.id);
  islands_.join(reported_, report.islands);
  reported_.clear();
}

bool Authority::has_peer(const HapticReport& report) const {
  return std::ranges::any_of(
      peers_, [&](BodyId peer) { return find_sorted(report.members, peer, &StampedBody::id) != report.members.end(); });
}

Owner Authority::owner(BodyId id) {
  if (labelled_ && !islands_.is_open(id)) return Owner::island;
  if (id == proxy_) return Owner::user;
  return std::ranges::find(peers_, id) != peers_.end() ? Owner::peer : Owner::world;
}

std::vector<BodyId> peers_of(const Scene& scene, std::size_t user) {
  std::vector<BodyId> peers;
  for (std::size_t u = 0; u < static_cast<std::size_t>(scene.settings.users); ++u) {
    if (u != user) peers.push_back(scene.users[u].proxy);
  }
  return peers;
}

}  // namespace subworld
