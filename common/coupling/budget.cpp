#include "coupling/budget.hpp"

#include <algorithm>
#include <cstdlib>

namespace subworld {

namespace {

constexpr double kPresentBonus = 1.5;  ///< on the importance of who is a member already
constexpr double kPresentLimit = 1.1;  ///< of the limit, for those
constexpr double kUnjoined = 1e-6;     ///< importance of what touches nothing that touches the proxy, next to it

double gap_m(const Box& a, const Box& b) noexcept {
  return (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0).norm();
}

}  // namespace

BudgetSelector::BudgetSelector(const Scene& scene)
    : scene_(scene),
      gravity_m_s2_(scene.settings.world.gravity.norm()),
      places_(scene.bodies.size(), Place::none),
      importance_(scene.bodies.size()),
      present_(scene.bodies.size()) {}

void BudgetSelector::offer(BodyId id, double importance) {
  if (places_[index(id)] != Place::candidate && places_[index(id)] != Place::ghost) return;
  if (importance <= importance_[index(id)] || importance_[index(id)] < 0.0) return;
  importance_[index(id)] = importance;
  const double counted = present_[index(id)] ? kPresentBonus * importance : importance;
  queue_.push_back({counted, id});
  std::ranges::push_heap(queue_, {}, [](const Candidate& c) { return std::pair(c.importance, ~index(c.id)); });
}

void BudgetSelector::spread(BodyId from, double importance, const ContactGraph& graph, double step_s) {
  double all_n = 0.0;
  const auto load_n = [&](const Neighbour& n) {
    return n.impulse_n_s / step_s + scene_.body(n.body).mass * gravity_m_s2_;
  };
  for (const Neighbour& n : graph.neighbours(from)) all_n += load_n(n);
  if (all_n <= 0.0) return;
  for (const Neighbour& n : graph.neighbours(from)) {
    if (scene_.body(n.body).fixed()) continue;
    // A pair may touch in several points.
    double pair_n = 0.0;
    for (const Neighbour& same : graph.neighbours(from)) {
      if (same.body == n.body) pair_n += load_n(same);
    }
    offer(n.body, importance * pair_n / all_n);
  }
}

void BudgetSelector::count(BodyId id, const ContactGraph& graph, bool simulates_border, std::size_t& bodies,
                           std::size_t& contacts) {
  if (places_[index(id)] != Place::ghost) ++bodies;
  for (const Neighbour& n : graph.neighbours(id)) {
    const bool movable = !scene_.body(n.body).fixed();
    const Place place = places_[index(n.body)];
    if (place == Place::member) {
      contacts += !simulates_border;  // else it was there, as a ghost's
      continue;
    }
    if (movable && !simulates_border) continue;
    ++contacts;
    if (movable && place != Place::ghost && std::ranges::find(ghosts_, n.body) == ghosts_.end()) {
      ghosts_.push_back(n.body);
      ++bodies;
    }
  }
}

void BudgetSelector::limit(BodyId proxy, std::span<const BodyId> present, const ContactGraph& graph, double step_s,
                           const std::function<Box(BodyId)>& bounds, const Budget& budget,
                           std::vector<BodyId>& members) {
  touched_.assign(members.begin(), members.end());
  queue_.clear();
  for (const BodyId id : present) present_[index(id)] = true;
  for (const BodyId id : members) {
    places_[index(id)] = Place::candidate;
    importance_[index(id)] = 0.0;
  }
  const Box near = bounds(proxy);
  for (const BodyId id : members) {
    const Box box = bounds(id);
    const double size_m = (box.upper - box.lower).maxCoeff();
    offer(id, id == proxy ? 1.0 : kUnjoined * size_m / (size_m + gap_m(near, box)));
  }
  std::size_t bodies = 0;
  std::size_t contacts = 0;
  std::size_t kept = 0;
  const auto by_importance = [](const Candidate& c) { return std::pair(c.importance, ~index(c.id)); };
  while (!queue_.empty()) {
    std::ranges::pop_heap(queue_, {}, by_importance);
    const BodyId id = queue_.back().id;
    queue_.pop_back();
    if (places_[index(id)] == Place::member) continue;
    std::size_t more_bodies = bodies;
    std::size_t more_contacts = contacts;
    ghosts_.clear();
    count(id, graph, budget.simulates_border, more_bodies, more_contacts);
    const double limit_s = (present_[index(id)] ? kPresentLimit : 1.0) * budget.limit_s;
    if (id != proxy && budget.cost.of(more_bodies, more_contacts) > limit_s) break;
    bodies = more_bodies;
    contacts = more_contacts;
    for (const BodyId ghost : ghosts_) {
      if (places_[index(ghost)] == Place::none) {
        importance_[index(ghost)] = -1.0;  // cannot become a member
        touched_.push_back(ghost);
      }
      places_[index(ghost)] = Place::ghost;
    }
    places_[index(id)] = Place::member;
    ++kept;
    spread(id, importance_[index(id)], graph, step_s);
  }
  cost_s_ = budget.cost.of(bodies, contacts);
  left_out_ = members.size() - kept;
  std::erase_if(members, [&](BodyId id) { return places_[index(id)] != Place::member; });
  for (const BodyId id : touched_) places_[index(id)] = Place::none;
  for (const BodyId id : present) present_[index(id)] = false;
}

}  // namespace subworld
