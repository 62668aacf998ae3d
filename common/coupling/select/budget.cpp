#include "coupling/select/budget.hpp"

#include "model/messages/exchange.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kPresentBonus = 1.5;  ///< on the importance of who is a member already
constexpr double kPresentLimit = 1.1;  ///< of the limit, for those
constexpr double kUnjoined = 1e-6;     ///< importance, next to the proxy, of what no contact joins to it

constexpr double kWorthwhile = 0.1;  ///< change of the factor that is taken over
constexpr double kLeastFactor = 0.1, kMostFactor = 100.0;

double gap_m(const Box& a, const Box& b) noexcept {
  return (a.lower - b.upper).cwiseMax(b.lower - a.upper).cwiseMax(0.0).norm();
}

}  // namespace

void CostCorrection::observe(double expected_s, double seen_s) noexcept {
  if (!(expected_s > 0.0) || !(seen_s > 0.0)) return;
  const double step = std::clamp(seen_s / expected_s / tracked_, 1.0 - tracking_, 1.0 + tracking_);
  tracked_ = std::clamp(tracked_ * step, kLeastFactor, kMostFactor);
  if (std::abs(tracked_ / factor_ - 1.0) > kWorthwhile) factor_ = tracked_;
}

BudgetSelector::BudgetSelector(const Scene& scene)
    : scene_(scene),
      mechanisms_(scene),
      gravity_m_s2_(scene.settings.world.gravity.norm()),
      standings_(scene.bodies.size()) {
  touched_.reserve(kUsualMembers);
  offers_.reserve(kUsualContacts);
  new_ghosts_.reserve(kUsualMembers);
}

bool BudgetSelector::before(const Offer& a, const Offer& b) noexcept {
  return a.importance != b.importance ? a.importance < b.importance : index(a.id) > index(b.id);
}

BudgetSelector::Standing& BudgetSelector::standing(BodyId id) {
  touched_.push_back(id);
  return standings_[index(id)];
}

void BudgetSelector::offer(BodyId id, double importance) {
  Standing& body = standings_[index(id)];
  if (!body.candidate || body.member || importance <= body.importance) return;
  body.importance = importance;
  offers_.push_back({body.present ? kPresentBonus * importance : importance, id});
  std::ranges::push_heap(offers_, before);
}

void BudgetSelector::spread(BodyId from, double importance, const ContactGraph& graph, double step_s) {
  // Two bodies may touch in several points, and each point counts the weight.
  const auto load_n = [&](const Neighbour& n) {
    return n.impulse_n_s / step_s + scene_.body(n.body).mass * gravity_m_s2_;
  };
  double all_n = 0.0;
  for (const Neighbour& n : graph.neighbours(from)) all_n += load_n(n);
  if (all_n <= 0.0) return;
  for (const Neighbour& n : graph.neighbours(from)) {
    double pair_n = 0.0;
    for (const Neighbour& same : graph.neighbours(from)) {
      if (same.body == n.body) pair_n += load_n(same);
    }
    offer(n.body, importance * pair_n / all_n);
  }
}

BudgetSelector::Size BudgetSelector::with(BodyId id, Size size, const ContactGraph& graph, bool simulates_border) {
  new_ghosts_.clear();
  if (!standings_[index(id)].ghost) ++size.bodies;
  for (const Neighbour& n : graph.neighbours(id)) {
    const Standing& other = standings_[index(n.body)];
    const bool fixed = scene_.body(n.body).fixed();
    // The contact of a member with a ghost, as this one was, is there already.
    if (other.member ? !simulates_border : fixed || simulates_border) ++size.contacts;
    if (other.member || fixed || !simulates_border || other.ghost) continue;
    if (std::ranges::find(new_ghosts_, n.body) == new_ghosts_.end()) new_ghosts_.push_back(n.body);
  }
  size.bodies += new_ghosts_.size();
  return size;
}

void BudgetSelector::limit(BodyId proxy, std::span<const BodyId> present, const ContactGraph& graph, double step_s,
                           std::span<const PeerContact> peers, const std::function<Box(BodyId)>& bounds,
                           const Budget& budget, std::vector<BodyId>& members) {
  for (const BodyId id : members) standing(id).candidate = true;
  for (const BodyId id : present) standing(id).present = true;
  const Box near = bounds(proxy);
  for (const BodyId id : members) {
    const Box box = bounds(id);
    const double size_m = (box.upper - box.lower).maxCoeff();
    offer(id, id == proxy ? 1.0 : kUnjoined * size_m / (size_m + gap_m(near, box)));
  }
  Size size;
  while (!offers_.empty()) {
    std::ranges::pop_heap(offers_, before);
    const BodyId id = offers_.back().id;
    offers_.pop_back();
    Standing& next = standings_[index(id)];
    if (next.member) continue;
    const Size more = with(id, size, graph, budget.simulates_border);
    const double limit_s = (next.present ? kPresentLimit : 1.0) * budget.limit_s;
    const bool stays = id == proxy || next.joined;
    if (!stays && budget.cost.of(more.bodies, more.contacts) > limit_s) break;
    size = more;
    next.member = true;
    for (const BodyId ghost : new_ghosts_) standing(ghost).ghost = true;
    spread(id, next.importance, graph, step_s);
    for (const BodyId with : mechanisms_.of(id)) {
      standings_[index(with)].joined = true;
      offer(with, next.importance);
    }
    for (const PeerContact& peer : peers) {
      if (peer.body == id) offer(peer.proxy, next.importance);
    }
  }
  offers_.clear();
  cost_s_ = budget.cost.of(size.bodies, size.contacts);
  omitted_ = std::erase_if(members, [&](BodyId id) { return !standings_[index(id)].member; });
  for (const BodyId id : touched_) standings_[index(id)] = {};
  touched_.clear();
}

}  // namespace subworld
