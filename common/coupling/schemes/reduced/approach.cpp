#include "coupling/schemes/reduced/approach.hpp"

#include "coupling/select/border.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr double kEdge = 1e-3;   ///< of the smaller body: what overlaps by less does so at an edge
constexpr double kAcross = 0.5;  ///< cosine; directions that are steeper to a normal are across it
/// Bodies found, and pairs of them, at most: first those that may meet the inside itself. Where thousands of bodies
/// move and the world is late, all of them may come until the next frame: without limits, one frame of 2,000 cubes took
/// 14 s.
constexpr std::size_t kMostFound = 64, kMostPairs = 512;

/// How far a shape reaches from its origin along a unit vector of the body frame, m.
double extent(const Shape& shape, std::span<const Mesh> meshes, const Vec3& along) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.half_extents.dot(along.cwiseAbs());
    case ShapeKind::capsule:
      return shape.radius + shape.half_length * std::abs(along.z());
    case ShapeKind::cylinder:
      return shape.radius * along.head<2>().norm() + shape.half_length * std::abs(along.z());
    case ShapeKind::convex:
    case ShapeKind::compound: {
      double most = 0.0;
      for (const Vec3& vertex : meshes[shape.mesh].vertices) most = std::max(most, along.dot(vertex));
      return most;
    }
    default:
      return shape.radius;
  }
}

double smallest(const Box& bounds) noexcept { return (bounds.upper - bounds.lower).minCoeff(); }

}  // namespace

ApproachFinder::ApproachFinder(const Scene& scene)
    : scene_(scene), places_(scene.bodies.size()), hooks_(scene.bodies.size()), listed_(scene.bodies.size()) {
  touched_.reserve(2 * scene.bodies.size());
  pushers_.reserve(scene.bodies.size());
  near_.reserve(scene.bodies.size());
  linked_.reserve(scene.bodies.size());
}

Box ApproachFinder::Mover::swept() const noexcept { return bounds.grown(travel_m); }

ApproachFinder::Mover ApproachFinder::mover(BodyId id, const BodyState& state, const Box& bounds) const noexcept {
  const double any_way_m = subworld::any_way_m(state, bounds, scene_.settings.world.gravity.norm(), time_s_);
  return {id, state, bounds, any_way_m, any_way_m + time_s_ * state.linear_velocity.norm()};
}

void ApproachFinder::begin(double time_s) {
  time_s_ = time_s;
  pushers_.clear();
  done_ = found_ = 0;
  near_.clear();
  for (const BodyId id : touched_) {
    places_[index(id)] = Place::apart;
    listed_[index(id)] = false;
  }
  touched_.clear();
}

void ApproachFinder::put(BodyId id, Place place) {
  if (std::exchange(places_[index(id)], place) == Place::apart) touched_.push_back(id);
}

void ApproachFinder::inside(BodyId id, const BodyState& state, const Box& bounds) {
  put(id, Place::inside);
  pushers_.push_back(mover(id, state, bounds));
}

Box ApproachFinder::ghost(BodyId id, const BodyState& state, const Box& bounds) {
  return pushers_.emplace_back(mover(id, state, bounds)).swept();
}

void ApproachFinder::attach(std::size_t first, const Membership& membership, const ContactGraph& graph) {
  for (std::size_t k = first; k < linked_.size(); ++k) {
    for (const auto& [next, outwards, impulse, i] : graph.neighbours(linked_[k])) {
      if (places_[index(next)] != Place::apart || scene_.body(next).fixed() || membership.holds(next)) continue;
      put(next, Place::hanging);
      hooks_[index(next)] = i;
      linked_.push_back(next);
    }
  }
}

std::span<const BodyId> ApproachFinder::touching(const Membership& membership, const ContactGraph& graph,
                                                 std::span<const BoundaryContact> contacts) {
  linked_.clear();
  for (const BoundaryContact& pair : contacts) {
    if (places_[index(pair.outside)] != Place::apart) continue;
    put(pair.outside, Place::touching);
    linked_.push_back(pair.outside);
  }
  attach(0, membership, graph);
  return linked_;
}

bool ApproachFinder::pushed(const BoundaryContact& pair, const ContactGraph& graph) const {
  BodyId pusher = pair.inside;
  while (places_[index(pusher)] == Place::hanging) {
    const Contact& hook = graph.contact(hooks_[index(pusher)]);
    if (std::abs(hook.normal.dot(pair.normal)) < kAcross) return false;
    pusher = hook.a == pusher ? hook.b : hook.a;
  }
  return pusher != pair.outside;
}

void ApproachFinder::unhang(BodyId hanging, const ContactGraph& graph, std::vector<BoundaryContact>& border) {
  while (places_[index(hanging)] == Place::hanging) {
    put(hanging, Place::found);
    const Contact& hook = graph.contact(hooks_[index(hanging)]);
    const BodyId pusher = hook.a == hanging ? hook.b : hook.a;
    for (const Neighbour& n : graph.neighbours(hanging)) {
      if (n.body == pusher) border.push_back(pair_of(graph.contact(n.index), pusher));
    }
    hanging = pusher;
  }
}

bool ApproachFinder::may_come(BodyId id) const {
  const Place place = places_[index(id)];
  return (place == Place::apart || place == Place::touching) && !listed_[index(id)] && !scene_.body(id).fixed();
}

void ApproachFinder::outside(BodyId id, const BodyState& state, const Box& bounds, const Box& where) {
  const Mover comes = mover(id, state, bounds);
  if (!comes.swept().meets(where)) return;
  listed_[index(id)] = true;
  touched_.push_back(id);
  near_.push_back(comes);
}

double ApproachFinder::reach_m(const Mover& mover, const Vec3& along) const {
  return extent(scene_.body(mover.id).shape, scene_.meshes, mover.state.orientation.conjugate() * along);
}

ApproachFinder::Gap ApproachFinder::gap_along(Vec3 normal, const Mover& one, const Mover& other) const {
  const Vec3 apart = one.state.position - other.state.position;
  if (normal.dot(apart) < 0.0) normal = -normal;
  return {normal, normal.dot(apart) - reach_m(one, -normal) - reach_m(other, normal)};
}

std::optional<BoundaryContact> ApproachFinder::meet(const Mover& pusher, const Mover& other) const {
  const Vec3 apart = pusher.state.position - other.state.position;
  const Eigen::Matrix3d mine = pusher.state.orientation.toRotationMatrix();
  const Eigen::Matrix3d theirs = other.state.orientation.toRotationMatrix();
  std::array<Gap, 7> gaps;
  gaps[0] = gap_along(apart.norm() > 0.0 ? apart.normalized() : Vec3::UnitZ(), pusher, other);
  for (int i = 0; i < 3; ++i) {
    gaps[1 + i] = gap_along(mine.col(i), pusher, other);
    gaps[4 + i] = gap_along(theirs.col(i), pusher, other);
  }
  const Gap gap = *std::ranges::max_element(gaps, {}, &Gap::distance);
  const Vec3 closing = other.state.linear_velocity - pusher.state.linear_velocity;
  const auto left_m = [&](const Gap& g) { return g.distance - std::max(0.0, time_s_ * g.normal.dot(closing)); };
  if (left_m(gap) > pusher.any_way_m + other.any_way_m) return std::nullopt;
  // Neighbours over an edge pass each other.
  const double edge_m = kEdge * std::min(smallest(pusher.bounds), smallest(other.bounds));
  const auto beside = [&](const Gap& g) { return std::abs(g.normal.dot(gap.normal)) < kAcross && left_m(g) > -edge_m; };
  if (std::any_of(gaps.begin() + 1, gaps.end(), beside)) return std::nullopt;
  return BoundaryContact{.inside = pusher.id,
                         .outside = other.id,
                         .point = pusher.state.position - reach_m(pusher, -gap.normal) * gap.normal,
                         .normal = gap.normal,
                         .distance = std::max(0.0, gap.distance)};
}

std::optional<Box> ApproachFinder::find(const Membership& membership, const ContactGraph& graph,
                                        std::vector<BoundaryContact>& border) {
  const auto known = [&](BodyId in, BodyId out) {
    return std::ranges::any_of(border, [&](const BoundaryContact& p) { return p.inside == in && p.outside == out; });
  };
  const auto wanted = [&](const Mover& pusher, const Mover& other) {
    const bool member = places_[index(pusher.id)] == Place::inside;
    switch (places_[index(other.id)]) {
      case Place::apart:
        return true;
      case Place::found:
        return other.id != pusher.id && !known(other.id, pusher.id);
      case Place::touching:
        return member && !known(pusher.id, other.id);
      default:
        return false;
    }
  };
  std::optional<Box> where;
  if (done_ == 0) contacts_ = border.size();
  for (const std::size_t end = pushers_.size(); done_ < end; ++done_) {
    const Mover pusher = pushers_[done_];
    const Box swept = pusher.swept();
    for (const Mover& other : near_) {
      if (border.size() >= contacts_ + kMostPairs) return std::nullopt;
      if (!swept.meets(other.swept()) || !wanted(pusher, other)) continue;
      if (places_[index(other.id)] == Place::apart && found_ == kMostFound) continue;
      const std::optional<BoundaryContact> pair = meet(pusher, other);
      if (!pair || !pushed(*pair, graph)) continue;
      unhang(pusher.id, graph, border);
      border.push_back(*pair);
      if (places_[index(other.id)] != Place::apart) continue;
      put(other.id, Place::found);
      ++found_;
      linked_.push_back(other.id);
      attach(linked_.size() - 1, membership, graph);
      pushers_.push_back(other);
      if (!where) where = other.swept();
      where->extend(other.swept());
    }
  }
  return where;
}

}  // namespace subworld
