#include "coupling/approach.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

namespace {

constexpr double kEdge = 1e-3;   ///< of the smaller body: what overlaps by less does so at an edge
constexpr double kAcross = 0.5;  ///< cosine; directions that are steeper to a normal are across it

/// How far a shape reaches from its origin along a unit vector of the body frame, m.
double extent(const Shape& shape, std::span<const Mesh> meshes, const Vec3& along) {
  switch (shape.kind) {
    case ShapeKind::box:
      return shape.half_extents.dot(along.cwiseAbs());
    case ShapeKind::capsule:
      return shape.radius + shape.half_length * std::abs(along.z());
    case ShapeKind::cylinder:
      return shape.radius * along.head<2>().norm() + shape.half_length * std::abs(along.z());
    case ShapeKind::convex: {
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
    : scene_(scene), touches_(scene.bodies.size()), hangs_(scene.bodies.size()) {
  inside_.reserve(scene.bodies.size());
  outside_.reserve(scene.bodies.size());
  hanging_.reserve(scene.bodies.size());
}

Box ApproachFinder::Mover::swept() const noexcept {
  return {bounds.lower - Vec3::Constant(travel_m), bounds.upper + Vec3::Constant(travel_m)};
}

ApproachFinder::Mover ApproachFinder::mover(BodyId id, const BodyState& state, const Box& bounds) const noexcept {
  const double arm_m = 0.5 * (bounds.upper - bounds.lower).norm();
  const double falling_m_s = 0.5 * time_s_ * scene_.settings.world.gravity.norm();
  const double any_way_m = time_s_ * (arm_m * state.angular_velocity.norm() + falling_m_s);
  return {id, state, bounds, any_way_m, any_way_m + time_s_ * state.linear_velocity.norm()};
}

void ApproachFinder::begin(double time_s) {
  time_s_ = time_s;
  inside_.clear();
  outside_.clear();
}

Box ApproachFinder::inside(BodyId id, const BodyState& state, const Box& bounds) {
  return inside_.emplace_back(mover(id, state, bounds)).swept();
}

void ApproachFinder::outside(BodyId id, const BodyState& state, const Box& bounds) {
  outside_.push_back(mover(id, state, bounds));
}

void ApproachFinder::leave_what_hangs(const Membership& membership, const ContactGraph& graph,
                                      std::span<const BorderPair> contacts) {
  touches_.assign(touches_.size(), false);
  hangs_.assign(hangs_.size(), false);
  hanging_.clear();
  const auto hang = [&](BodyId id) {
    if (hangs_[index(id)]) return;
    hangs_[index(id)] = true;
    hanging_.push_back(id);
  };
  for (const BorderPair& pair : contacts) {
    touches_[index(pair.outside)] = true;
    hang(pair.outside);
  }
  for (std::size_t k = 0; k < hanging_.size(); ++k) {
    for (const std::uint32_t i : graph.of(hanging_[k])) {
      const Contact& c = graph.contact(i);
      const BodyId next = c.a == hanging_[k] ? c.b : c.a;
      if (!scene_.body(next).fixed() && !membership.holds(next)) hang(next);
    }
  }
  std::erase_if(outside_, [&](const Mover& out) { return hangs_[index(out.id)] && !touches_[index(out.id)]; });
}

double ApproachFinder::reach_m(const Mover& mover, const Vec3& along) const {
  return extent(scene_.body(mover.id).shape, scene_.meshes, mover.state.orientation.conjugate() * along);
}

ApproachFinder::Gap ApproachFinder::gap_along(Vec3 normal, const Mover& in, const Mover& out) const {
  const Vec3 apart = in.state.position - out.state.position;
  if (normal.dot(apart) < 0.0) normal = -normal;
  return {normal, normal.dot(apart) - reach_m(in, -normal) - reach_m(out, normal)};
}

void ApproachFinder::meet(const Mover& in, const Mover& out, std::vector<BorderPair>& border) const {
  const Vec3 apart = in.state.position - out.state.position;
  const Eigen::Matrix3d mine = in.state.orientation.toRotationMatrix();
  const Eigen::Matrix3d theirs = out.state.orientation.toRotationMatrix();
  std::array<Gap, 7> gaps;
  gaps[0] = gap_along(apart.norm() > 0.0 ? apart.normalized() : Vec3::UnitZ(), in, out);
  for (int i = 0; i < 3; ++i) {
    gaps[1 + i] = gap_along(mine.col(i), in, out);
    gaps[4 + i] = gap_along(theirs.col(i), in, out);
  }
  const Gap gap = *std::ranges::max_element(gaps, {}, &Gap::distance);
  const Vec3 closing = out.state.linear_velocity - in.state.linear_velocity;
  const auto left_m = [&](const Gap& g) { return g.distance - std::max(0.0, time_s_ * g.normal.dot(closing)); };
  if (left_m(gap) > in.any_way_m + out.any_way_m) return;
  // Neighbours over an edge pass each other.
  const double edge_m = kEdge * std::min(smallest(in.bounds), smallest(out.bounds));
  const auto beside = [&](const Gap& g) { return std::abs(g.normal.dot(gap.normal)) < kAcross && left_m(g) > -edge_m; };
  if (std::any_of(gaps.begin() + 1, gaps.end(), beside)) return;
  border.push_back({.inside = in.id,
                    .outside = out.id,
                    .point = in.state.position - reach_m(in, -gap.normal) * gap.normal,
                    .normal = gap.normal,
                    .distance = std::max(0.0, gap.distance),
                    .tangential_velocity = gap.normal.dot(closing) * gap.normal - closing});
}

void ApproachFinder::find(const Membership& membership, const ContactGraph& graph, std::vector<BorderPair>& border) {
  const std::size_t contacts = border.size();
  leave_what_hangs(membership, graph, border);
  const auto touch = [&](BodyId in, BodyId out) {
    const auto same = [&](const BorderPair& p) { return p.inside == in && p.outside == out; };
    return touches_[index(out)] && std::ranges::any_of(std::span(border.data(), contacts), same);
  };
  for (const Mover& in : inside_) {
    const Box swept = in.swept();
    for (const Mover& out : outside_) {
      if (swept.meets(out.swept()) && !touch(in.id, out.id)) meet(in, out, border);
    }
  }
}

}  // namespace subworld
