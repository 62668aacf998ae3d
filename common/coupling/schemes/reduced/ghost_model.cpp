#include "coupling/schemes/reduced/ghost_model.hpp"

#include "coupling/schemes/reduced/rolling.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

// What was tried for each constant: coupling/RESULTS.md.
constexpr double kPushing = 0.5;    ///< cosine: a contact closer to the push transmits it, any other is a side contact
constexpr double kOnSupport = 0.3;  ///< cosine: a push that is steeper to a support does not press on it
constexpr double kSameWay = 0.7;    ///< cosine: border contacts of one axis, pushes of one direction
constexpr double kDistinct = 0.5;   ///< sine to the axes there are; what is closer to them is no axis of its own
constexpr double kWallMass_kg = 1e5;     ///< of what cannot give way: heavier than anything that it meets
constexpr double kSliding_m_s = -0.002;  ///< faster away from the inside than this: the outside slides

double friction(const Scene& scene, BodyId a, BodyId b) noexcept {
  return in_contact(scene.body(a).material, scene.body(b).material, scene.settings.world.pairs).friction;
}

/// The part of a vector across the axes that there are.
Vec3 across(const GhostModel& ghost, Vec3 v) noexcept {
  for (std::size_t i = 0; i < ghost.axis_count; ++i) v -= v.dot(ghost.axes[i].normal) * ghost.axes[i].normal;
  return v;
}

}  // namespace

GhostModeller::GhostModeller(const Scene& scene)
    : scene_(scene), carried_(scene), in_way_(scene.bodies.size()), counted_(scene.bodies.size()) {
  way_.reserve(scene.bodies.size());
  holds_.reserve(64);
  pushed_.reserve(4 * scene.bodies.size());
  approaching_.reserve(scene.bodies.size());
}

bool GhostModeller::push(BodyId from, const Vec3& along, const Surroundings& around) {
  bool gives = true;
  way_.assign(1, from);
  in_way_[index(from)] = ++walk_;
  for (std::size_t k = 0; k < way_.size(); ++k) {
    const BodyId id = way_[k];
    for (const Neighbour& n : around.graph.neighbours(id)) {
      const BodyId next = n.body;
      if (along.dot(n.outwards) <= kPushing || in_engine(next, around)) continue;
      if (scene_.body(next).fixed()) {
        gives = false;
      } else if (std::exchange(in_way_[index(next)], walk_) != walk_) {
        way_.push_back(next);
      }
    }
  }
  return gives;
}

bool GhostModeller::in_engine(BodyId id, const Surroundings& around) const {
  return std::ranges::binary_search(around.membership.members, id) || std::ranges::binary_search(approaching_, id);
}

bool GhostModeller::pushed_by_another(BodyId body, BodyId from, const Vec3& along) const {
  const auto same = std::ranges::equal_range(pushed_, body, {}, &Pushed::body);
  return std::ranges::any_of(same, [&](const Pushed& p) { return p.from != from && p.along.dot(along) > kSameWay; });
}

std::optional<GhostModeller::Rolling> GhostModeller::rolling(BodyId id, const Vec3& along,
                                                             const Surroundings& around) const {
  const Body& body = scene_.body(id);
  std::optional<BodyId> support;
  Vec3 normal = Vec3::Zero();
  double support_n = 0.0;
  Rolling found;
  for (const Neighbour& n : around.graph.neighbours(id)) {
    const BodyId beside = n.body;
    const double friction_n = friction(scene_, id, beside) * n.impulse_n_s / around.step_s;
    if (std::abs(along.dot(n.outwards)) > kPushing) {
      found.resistance_n += friction_n;
      continue;
    }
    if (support && *support != beside) return std::nullopt;
    support = beside;
    normal += n.outwards;
    support_n += friction_n;
  }
  if (!support || in_engine(*support, around)) return std::nullopt;
  const auto mass_kg = rolling_mass(body, around.motions[index(id)].state.orientation, along.cross(normal));
  if (!mass_kg || found.resistance_n > support_n) return std::nullopt;
  found.mass_kg = *mass_kg;
  return found;
}

GhostModeller::EffectiveMass GhostModeller::walk(BodyId from, const Vec3& along, const Surroundings& around) {
  if (!push(from, along, around)) return {.mass_kg = kWallMass_kg, .wall = true};
  EffectiveMass found;
  const auto count = [&](BodyId id) {
    if (std::exchange(counted_[index(id)], walk_) == walk_) return;
    found.mass_kg += scene_.body(id).mass;
    found.inertial_n += scene_.body(id).mass * around.motions[index(id)].acceleration;
    if (scene_.body(id).gravity) found.heavy_kg += scene_.body(id).mass;
  };
  std::ranges::for_each(way_, count);
  holds_.clear();
  for (const BodyId id : way_) {
    const std::optional<Rolling> rolls = rolling(id, along, around);
    if (rolls) {
      found.mass_kg += rolls->mass_kg;
      found.inertial_n += rolls->mass_kg * around.motions[index(id)].acceleration;
      found.limit_n += rolls->resistance_n;
    }
    for (const Neighbour& n : around.graph.neighbours(id)) {
      const BodyId beside = n.body;
      const double mu = friction(scene_, id, beside);
      if (rolls || std::abs(along.dot(n.outwards)) > kPushing) continue;
      if (in_engine(beside, around) || pushed_by_another(beside, from, along)) continue;
      if (scene_.body(beside).is_driven()) {
        found.driven = true;
      } else if (scene_.body(beside).fixed()) {
        found.limit_n += mu * n.impulse_n_s / around.step_s;
        if (id == from) holds_.push_back({n.outwards, n.impulse_n_s, mu});
      } else {
        count(beside);
      }
    }
  }
  found.load_dependent_friction = load_dependent_friction();
  return found;
}

Vec3 GhostModeller::load_dependent_friction() const {
  Vec3 sum = Vec3::Zero();
  for (const Hold& hold : holds_) {
    double all_this_way = 0.0;
    for (const Hold& beside : holds_) {
      if (beside.outwards.dot(hold.outwards) > kSameWay) all_this_way += beside.impulse_n_s;
    }
    if (all_this_way > 0.0) sum += hold.friction * hold.impulse_n_s / all_this_way * hold.outwards;
  }
  return sum;
}

Vec3 GhostModeller::support_direction(BodyId id, const Vec3& along, const ContactGraph& graph) const {
  double most = kOnSupport;
  Vec3 way = along;
  for (const Neighbour& n : graph.neighbours(id)) {
    const double towards = along.dot(n.outwards);
    if (towards <= most || !scene_.body(n.body).fixed()) continue;
    most = towards;
    way = n.outwards;
  }
  return way;
}

void GhostModeller::find_axes(std::span<const BoundaryContact> border, const ContactGraph& graph,
                              GhostModel& ghost) const {
  // The contact with the largest impulse that no axis serves yet begins the next one.
  ghost.axis_count = 0;
  while (ghost.axis_count < kMostGhostAxes) {
    const BoundaryContact* first = nullptr;
    for (const BoundaryContact& pair : border) {
      if (pair.outside != ghost.outside || across(ghost, pair.normal).norm() < kSameWay) continue;
      if (first == nullptr || pair.normal_impulse > first->normal_impulse) first = &pair;
    }
    if (first == nullptr) return;
    const Vec3 way = across(ghost, first->normal).normalized();
    const Vec3 held = across(ghost, -support_direction(ghost.outside, -way, graph));
    ghost.axes[ghost.axis_count++] = {.normal = held.norm() > kDistinct ? held.normalized() : way};
  }
}

void GhostModeller::add_unconstrained_directions(const Motion& motion, const Surroundings& around, GhostModel& ghost) {
  if (ghost.mass_kg >= kWallMass_kg) return;
  const auto held = [&](const Vec3& along) {
    const EffectiveMass found = walk(ghost.outside, along, around);
    return found.wall || found.limit_n > 0.0;
  };
  for (int i = 0; i < 3; ++i) {
    if (ghost.axis_count == kMostGhostAxes) return;
    const Vec3 way = across(ghost, Vec3::Unit(i));
    if (way.norm() < kDistinct) continue;
    const Vec3 along = way.normalized();
    if (held(along) || held(-along)) continue;
    const double rest_n = ghost.mass_kg * motion.acceleration.dot(along) - ghost.load_n.dot(along);
    ghost.axes[ghost.axis_count++] = {.normal = along, .force_n = rest_n};
  }
}

void GhostModeller::list(std::span<const BoundaryContact> border, const Membership& membership,
                         std::vector<GhostModel>& out) {
  out.clear();
  for (const BoundaryContact& pair : border) {
    const auto at = std::ranges::lower_bound(out, pair.outside, {}, &GhostModel::outside);
    if (at == out.end() || at->outside != pair.outside) out.insert(at, GhostModel{.outside = pair.outside, .axes = {}});
  }
  approaching_.clear();
  for (GhostModel& ghost : out) {
    const auto touched = [&](const BoundaryContact& pair) {
      return pair.outside == ghost.outside && touches(pair) &&
             std::ranges::binary_search(membership.members, pair.inside);
    };
    ghost.approaching = std::ranges::none_of(border, touched);
    if (ghost.approaching) approaching_.push_back(ghost.outside);
  }
}

void GhostModeller::find_pushed(std::span<const GhostModel> ghosts, const Surroundings& around) {
  pushed_.clear();
  for (const GhostModel& ghost : ghosts) {
    if (ghost.approaching) continue;  // it collides with the bodies that it pushes
    for (std::size_t i = 0; i < ghost.axis_count; ++i) {
      const Vec3 along = -ghost.axes[i].normal;
      if (!push(ghost.outside, along, around)) continue;
      for (const BodyId id : way_) pushed_.push_back({id, ghost.outside, along});
    }
  }
  std::ranges::sort(pushed_, {}, &Pushed::body);
}

GhostModeller::Pulled GhostModeller::find_peers(std::uint32_t axis, const Surroundings& around, const GhostModel& ghost,
                                                std::vector<GhostPeer>& peers) const {
  Pulled found;
  for (const UserPull& pull : around.pulls) {
    if (std::ranges::find(way_, pull.proxy) == way_.end()) continue;
    (pull.spring ? found.by_springs : found.by_forces) += pull.force_n;
    if (!pull.spring) continue;
    const Vec3& from = around.motions[index(ghost.outside)].state.position;
    const Vec3& to = around.motions[index(pull.proxy)].state.position;
    peers.push_back({ghost.outside, axis, pull.proxy, ghost.axes[axis].normal.dot(to - from)});
  }
  return found;
}

void GhostModeller::model_axis(std::uint32_t number, const Surroundings& around, GhostModel& ghost,
                               std::vector<GhostPeer>& peers) {
  GhostAxis& axis = ghost.axes[number];
  const Motion& motion = around.motions[index(ghost.outside)];
  const double load_n = -ghost.load_n.dot(axis.normal);
  const EffectiveMass found = walk(ghost.outside, -axis.normal, around);
  if (found.wall) {
    axis.force_n = std::max(0.0, load_n);
    axis.coulomb_limit_n = kWallLimit_n;
    return;
  }
  const Pulled pulled = find_peers(number, around, ghost, peers);
  const double q = load_n + (found.inertial_n - pulled.by_springs - pulled.by_forces).dot(axis.normal);
  double f = found.heavy_kg * scene_.settings.world.gravity.dot(axis.normal);
  if (found.driven) f = q;  // a belt's friction goes on as it is
  double c = found.limit_n;
  const bool slides = motion.state.linear_velocity.dot(axis.normal) < kSliding_m_s && load_n > 0.0;
  c = slides ? std::max(0.0, q - f) : std::max(c, q - f);
  f = std::clamp(f, q - c, q + c);
  axis.force_n = f + pulled.by_forces.dot(axis.normal);
  axis.coulomb_limit_n = c;
  axis.load_dependent_friction = found.load_dependent_friction;
  if (ghost.mass_kg == 0.0) ghost.mass_kg = found.mass_kg;  // the heaviest loaded way that gives
}

void GhostModeller::model(std::span<const BoundaryContact> border, const Surroundings& around,
                          std::vector<GhostModel>& out, std::vector<GhostPeer>& peers) {
  peers.clear();
  list(border, around.membership, out);
  for (const BoundaryContact& pair : border) {
    const Vec3 on_inside_n = (pair.normal_impulse * pair.normal + pair.tangential_impulse) / around.step_s;
    find_sorted(out, pair.outside, &GhostModel::outside)->load_n -= on_inside_n;
    const auto pusher = find_sorted(out, pair.inside, &GhostModel::outside);
    if (pusher != out.end()) pusher->load_n += on_inside_n;
  }
  for (GhostModel& ghost : out) find_axes(border, around.graph, ghost);
  find_pushed(out, around);
  carried_.begin(out, around.membership, around.graph);
  const auto state_of = [&around](BodyId id) { return around.motions[index(id)].state; };
  for (GhostModel& ghost : out) {
    ghost.carried = carried_.model(ghost.outside, state_of);
    for (std::uint32_t i = 0; i < ghost.axis_count; ++i) model_axis(i, around, ghost, peers);
    if (ghost.mass_kg == 0.0) ghost.mass_kg = kWallMass_kg;
    if (!ghost.carried) add_unconstrained_directions(around.motions[index(ghost.outside)], around, ghost);
  }
}

Vec3 clearance(const GhostModel& ghost, std::span<const BoundaryContact> border,
               const std::function<Vec3(BodyId)>& offset_of) {
  Vec3 move = Vec3::Zero();
  for (std::size_t i = 0; i < ghost.axis_count; ++i) {
    double deepest = 0.0;
    for (const BoundaryContact& pair : border) {
      if (pair.outside != ghost.outside || pair.normal.dot(ghost.axes[i].normal) < kSameWay) continue;
      deepest = std::min(deepest, pair.distance + pair.normal.dot(offset_of(pair.inside)));
    }
    move += deepest * ghost.axes[i].normal;
  }
  return move;
}

}  // namespace subworld
