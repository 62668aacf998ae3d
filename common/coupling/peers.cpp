#include "coupling/peers.hpp"

#include <algorithm>

namespace subworld {

PeerFinder::PeerFinder(const Scene& scene) : scene_(scene) {
  for (const Body& body : scene.bodies) from_.push_back(body.id);
}

void PeerFinder::visit(BodyId id, BodyId from) {
  const bool known = id == visited_.front() || from_[index(id)] != id;
  if (known || scene_.body(id).fixed()) return;
  from_[index(id)] = from;
  visited_.push_back(id);
}

std::span<const PeerContact> PeerFinder::find(BodyId proxy, std::span<const BodyId> peers, const ContactGraph& graph,
                                              const Reachable& reachable, const Fits& fits,
                                              std::vector<BodyId>& bodies) {
  coming_.clear();
  links_.clear();
  for (const BodyId peer : peers) {
    reachable(peer, near_);
    for (const BodyId id : near_) coming_.push_back({id, peer});
  }
  reachable(proxy, near_);
  visited_.assign(1, proxy);
  for (const BodyId id : near_) visit(id, proxy);
  std::size_t contact_ends = 0;  // two of a contact, except with a fixed body
  bool whole = true;
  for (std::size_t k = 0; k < visited_.size() && (whole || links_.size() < peers.size()); ++k) {
    const BodyId id = visited_[k];
    if (std::ranges::find(peers, id) != peers.end()) links_.push_back({from_[index(id)], id});
    for (const Neighbour& n : graph.neighbours(id)) {
      contact_ends += scene_.body(n.body).fixed() ? 2 : 1;
      visit(n.body, id);
    }
    whole = whole && fits(k + 1, contact_ends / 2);
    for (const PeerContact& c : coming_) {
      if (c.body == id) visit(c.proxy, id);
    }
  }
  if (whole && !links_.empty()) bodies.insert(bodies.end(), visited_.begin(), visited_.end());
  for (const PeerContact& link : links_) {
    for (BodyId id = link.proxy; id != proxy; id = from_[index(id)]) bodies.push_back(id);
  }
  std::ranges::sort(bodies);
  const auto twice = std::ranges::unique(bodies);
  bodies.erase(twice.begin(), twice.end());
  for (const BodyId id : visited_) from_[index(id)] = id;
  return links_;
}

}  // namespace subworld
