#include "coupling/select/peers.hpp"

#include "model/messages/exchange.hpp"

#include <algorithm>

namespace subworld {

PeerFinder::PeerFinder(const Scene& scene)
    : is_proxy_(scene.bodies.size()), proxies_of_set_(scene.bodies.size()), first_coming_(scene.bodies.size(), kNone) {
  for (std::vector<BodyId>* list : {&visited_, &near_}) list->reserve(scene.bodies.size());
  coming_.reserve(kUsualMembers);
  sets_.reset(scene.bodies.size());
  for (const Body& body : scene.bodies) {
    fixed_.push_back(body.fixed());
    from_.push_back(body.id);
  }
}

void PeerFinder::join(BodyId a, BodyId b) noexcept {
  if (fixed(a) || fixed(b)) return;
  const std::uint32_t root_a = sets_.root(index(a)), root_b = sets_.root(index(b));
  if (root_a != root_b) sets_.join(root_a, root_b);
}

void PeerFinder::begin(std::span<const Contact> contacts, std::span<const BodyId> proxies, const Reachable& reachable) {
  for (const BodyId id : proxies_) is_proxy_[index(id)] = 0;
  proxies_.assign(proxies.begin(), proxies.end());
  for (const BodyId id : proxies_) is_proxy_[index(id)] = 1;
  const auto separate = [this](BodyId id) { sets_.separate(index(id)); };
  for (const Contact& c : contacts) {
    separate(c.a);
    separate(c.b);
  }
  for (const BodyId proxy : proxies_) {
    separate(proxy);
    reachable(proxy, near_);
    std::ranges::for_each(near_, separate);
  }
  for (const Contact& c : contacts) join(c.a, c.b);
  for (const BodyId proxy : proxies_) {
    reachable(proxy, near_);
    for (const BodyId id : near_) join(proxy, id);
  }
  for (const BodyId proxy : proxies_) proxies_of_set_[sets_.root(index(proxy))] = 0;
  for (const BodyId proxy : proxies_) ++proxies_of_set_[sets_.root(index(proxy))];
}

void PeerFinder::list_coming(BodyId proxy, const Reachable& reachable) {
  for (const Coming& c : coming_) first_coming_[index(c.body)] = kNone;
  coming_.clear();
  for (auto peer = proxies_.rbegin(); peer != proxies_.rend(); ++peer) {
    if (*peer == proxy) continue;
    reachable(*peer, near_);
    for (const BodyId id : near_) {
      coming_.push_back({id, *peer, first_coming_[index(id)]});
      first_coming_[index(id)] = static_cast<std::uint32_t>(coming_.size() - 1);
    }
  }
}

void PeerFinder::visit(BodyId id, BodyId from) {
  const bool known = id == visited_.front() || from_[index(id)] != id;
  if (known || fixed(id)) return;
  from_[index(id)] = from;
  visited_.push_back(id);
}

std::span<const PeerContact> PeerFinder::find(BodyId proxy, const ContactGraph& graph, const Reachable& reachable,
                                              const Fits& fits, std::vector<BodyId>& bodies) {
  links_.clear();
  if (proxies_of_set_[sets_.root(index(proxy))] < 2) return links_;
  list_coming(proxy, reachable);
  reachable(proxy, near_);
  visited_.assign(1, proxy);
  for (const BodyId id : near_) visit(id, proxy);
  std::size_t contact_ends = 0;  // two of a contact, except with a fixed body
  bool whole = true;
  for (std::size_t k = 0; k < visited_.size() && (whole || links_.size() + 1 < proxies_.size()); ++k) {
    const BodyId id = visited_[k];
    if (id != proxy && is_proxy_[index(id)] != 0) links_.push_back({from_[index(id)], id});
    for (const Neighbour& n : graph.neighbours(id)) {
      contact_ends += fixed(n.body) ? 2 : 1;
      visit(n.body, id);
    }
    whole = whole && fits(k + 1, contact_ends / 2);
    for (std::uint32_t c = first_coming_[index(id)]; c != kNone; c = coming_[c].next) visit(coming_[c].proxy, id);
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
