#include "coupling/schemes/reduced/carried.hpp"

#include "model/vectors.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

Eigen::Matrix3d cross_matrix(const Vec3& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Of a body alone about its centre.
Vec6 momentum(const Body& body, const Quat& orientation, const Vec6& velocity) {
  const Vec3 spin = orientation.conjugate() * Vec3(velocity.tail<3>());
  Vec6 p;
  p << body.mass * velocity.head<3>(), orientation * Vec3(body.inertia.cwiseProduct(spin));
  return p;
}

Vec6 velocity_of(const Body& body, const Quat& orientation, const Vec6& momentum) {
  const Vec3 turn = orientation.conjugate() * Vec3(momentum.tail<3>());
  Vec6 v;
  v << momentum.head<3>() / body.mass, orientation * Vec3(turn.cwiseQuotient(body.inertia));
  return v;
}

}  // namespace

CarriedModeller::CarriedModeller(const Scene& scene)
    : scene_(scene),
      holds_(scene.bodies.size(), Hold::unknown),
      layers_(scene.bodies.size(), 0),
      begins_(scene.bodies.size(), 0) {
  seen_.reserve(scene.bodies.size());
  carried_.reserve(scene.bodies.size());
  shares_.reserve(4 * scene.bodies.size());
}

void CarriedModeller::begin(std::span<const GhostModel> ghosts, const Membership& membership,
                            const ContactGraph& graph) {
  for (const BodyId id : seen_) holds_[index(id)] = Hold::unknown;
  for (const BodyId id : carried_) layers_[index(id)] = 0;
  seen_.clear();
  carried_.clear();
  shares_.clear();
  for (const GhostModel& ghost : ghosts) {
    if (!only_inside_holds(ghost.outside, membership, graph)) continue;
    layers_[index(ghost.outside)] = 1;
    begins_[index(ghost.outside)] = static_cast<std::uint32_t>(shares_.size());
    carried_.push_back(ghost.outside);
    shares_.push_back({ghost.outside, ghost.outside, 1.0});
  }
  for (std::size_t from = 0, to = carried_.size(); from < to; from = std::exchange(to, carried_.size()))
    share_next(from, to, membership, graph);
}

void CarriedModeller::share_next(std::size_t from, std::size_t to, const Membership& membership,
                                 const ContactGraph& graph) {
  constexpr double kNoLoad_n_s = 1e-12;  // contacts without a load count alike
  for (std::size_t k = from; k < to; ++k) {
    for (const Neighbour& n : graph.neighbours(carried_[k])) {
      if (layers_[index(n.body)] != 0 || std::ranges::binary_search(membership.members, n.body)) continue;
      layers_[index(n.body)] = layers_[index(carried_[k])] + 1;
      carried_.push_back(n.body);
    }
  }
  for (std::size_t k = to; k < carried_.size(); ++k) {
    const BodyId id = carried_[k];
    begins_[index(id)] = static_cast<std::uint32_t>(shares_.size());
    double sum = 0.0;
    for (const Neighbour& n : graph.neighbours(id)) {
      if (layers_[index(n.body)] + 1 != layers_[index(id)]) continue;
      const double load_n_s = n.impulse_n_s + kNoLoad_n_s;
      sum += load_n_s;
      for (std::size_t i = begins_[index(n.body)]; i < shares_.size() && shares_[i].body == n.body; ++i) {
        const Share by = shares_[i];
        const auto own = shares_.begin() + begins_[index(id)];
        const auto same = std::find_if(own, shares_.end(), [&](const Share& s) { return s.ghost == by.ghost; });
        if (same != shares_.end()) {
          same->part += load_n_s * by.part;
        } else {
          shares_.push_back({id, by.ghost, load_n_s * by.part});
        }
      }
    }
    for (std::size_t i = begins_[index(id)]; i < shares_.size(); ++i) shares_[i].part /= sum;
  }
}

bool CarriedModeller::only_inside_holds(BodyId outside, const Membership& membership, const ContactGraph& graph) {
  if (holds_[index(outside)] != Hold::unknown) return holds_[index(outside)] == Hold::inside;
  const std::size_t first = seen_.size();
  const auto settle = [&](Hold found) {
    for (std::size_t i = first; i < seen_.size(); ++i) holds_[index(seen_[i])] = found;
    return found == Hold::inside;
  };
  const auto see = [&](BodyId id) {
    holds_[index(id)] = Hold::inside;  // for now: seen
    seen_.push_back(id);
  };
  see(outside);
  for (std::size_t k = first; k < seen_.size(); ++k) {
    if (!scene_.body(seen_[k]).rotates) return settle(Hold::held);
    for (const Neighbour& n : graph.neighbours(seen_[k])) {
      const BodyId next = n.body;
      if (std::ranges::binary_search(membership.members, next)) continue;
      if (scene_.body(next).fixed() || holds_[index(next)] == Hold::held) return settle(Hold::held);
      if (holds_[index(next)] == Hold::unknown) see(next);
    }
  }
  return settle(Hold::inside);
}

std::optional<CarriedBody> CarriedModeller::model(BodyId outside,
                                                  const std::function<BodyState(BodyId)>& state_of) const {
  if (holds_[index(outside)] != Hold::inside) return std::nullopt;
  const Vec3 origin = state_of(outside).position;
  CarriedBody found;
  Eigen::Matrix3d about_origin = Eigen::Matrix3d::Zero();
  Vec3 moment = Vec3::Zero();
  for (const Share& share : shares_) {
    if (share.ghost != outside) continue;
    const Body& body = scene_.body(share.body);
    const BodyState state = state_of(body.id);
    const double mass_kg = share.part * body.mass;
    const Vec3 arm = state.position - origin;
    const Eigen::Matrix3d axes = state.orientation.toRotationMatrix();
    const Eigen::Matrix3d cross = cross_matrix(arm);
    found.mass_kg += mass_kg;
    moment += mass_kg * arm;
    about_origin += share.part * (axes * body.inertia.asDiagonal() * axes.transpose()) - mass_kg * cross * cross;
    if (body.gravity) {
      const Vec3 weight_n = mass_kg * scene_.settings.world.gravity;
      found.drive.force += weight_n;
      found.drive.torque += arm.cross(weight_n);
    }
  }
  found.centre_m = moment / found.mass_kg;
  const Eigen::Matrix3d cross = cross_matrix(found.centre_m);
  const Eigen::Matrix3d inertia = about_origin + found.mass_kg * cross * cross;
  // Symmetric to the last bit, as a frame carries it.
  found.inertia_kg_m2 << inertia(0, 0), inertia(0, 1), inertia(2, 0),  //
      inertia(0, 1), inertia(1, 1), inertia(1, 2),                     //
      inertia(2, 0), inertia(1, 2), inertia(2, 2);
  return found;
}

bool holds(const CarriedBody& whole, const Body& body) {
  constexpr double kRounding = 1e-6;
  const Eigen::Matrix3d cross = cross_matrix(whole.centre_m);
  const Eigen::Matrix3d inertia = whole.inertia_kg_m2 - whole.mass_kg * cross * cross;
  return whole.mass_kg >= (1.0 - kRounding) * body.mass &&
         is_positive_definite(inertia - (1.0 - kRounding) * body.inertia.minCoeff() * Eigen::Matrix3d::Identity());
}

void CarriedMotion::follow(const CarriedBody& whole) {
  const Eigen::Matrix3d cross = cross_matrix(whole.centre_m);
  const Eigen::Matrix3d turns = whole.inertia_kg_m2.inverse();
  mobility << Eigen::Matrix3d::Identity() / whole.mass_kg - cross * turns * cross, cross * turns,  //
      -turns * cross, turns;
  drive << whole.drive.force, whole.drive.torque;
}

Vec6 CarriedMotion::begin(const Body& body, const Quat& orientation, double dt) const {
  return velocity + mobility * (impulse + dt * drive) - velocity_of(body, orientation, impulse);
}

void CarriedMotion::end(const Body& body, const Quat& orientation, const Vec6& before, const Vec6& after, double dt) {
  impulse = momentum(body, orientation, after - before);
  velocity += mobility * (impulse + dt * drive);
}

}  // namespace subworld
