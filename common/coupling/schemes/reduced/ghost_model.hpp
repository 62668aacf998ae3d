#pragma once

#include "coupling/schemes/reduced/carried.hpp"
#include "coupling/schemes/sub_world_side.hpp"
#include "coupling/schemes/world_side.hpp"
#include "coupling/select/border.hpp"
#include "coupling/select/contact_graph.hpp"
#include "coupling/select/selection.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace subworld {

/// What is around a sub-world: a cycle of the world.
struct Surroundings {
  const Membership& membership;
  const ContactGraph& graph;        ///< totals over step_s
  std::span<const Motion> motions;  ///< by body
  double step_s;
  std::span<const UserPull> pulls = {};
};

/// Finds the reduced model of every outside body that touches inside ones: how heavy it is to push along the border's
/// normals, which force drives it and how much friction holds it. An axis of a model is the normal of the border
/// contact with the largest impulse, or of the fixed support that this presses the outside on: pressed obliquely, it is
/// the support that holds it, and along the support it slides. Other contacts become further axes, as far as they are
/// across the first ones, and so do the ways in which nothing but the inside holds the outside. What the inside alone
/// holds in every way has a model of its own (carried.hpp).
///
/// For each axis n the outside is walked from the body along d = -n. What it pushes adds its mass; something fixed
/// makes a wall. A side contact with something fixed adds mu lambda / T to the Coulomb limit; with a movable body it
/// adds that body's mass. What another ghost pushes the same way is no hold.
/// What rolls on something fixed adds its moment of inertia over its radius squared, and instead of mu lambda / T that
/// of the contacts by which it is pushed and pushes: on them it turns.
///
/// Force f = M g.n. Where the load p and the outside's motion say more than the walk can see, limit and force give way:
/// of p, q = p + sum(m a).n is what the inertia of all that is pushed does not take; sliding, c = q - f; at rest, c >=
/// q - f; and always |q - f| <= c. The limit holds under the load that the inside puts on the outside in the world;
/// what presses the ghost harder on its supports adds mu times as much (load-dependent friction).
///
/// Another user's proxy among what is pushed is held by a spring, not by friction: q is without the pull of its device,
/// and the ghost gets the spring instead (GhostPeer). The force of an operator at an admittance device adds to f.
class GhostModeller {
 public:
  explicit GhostModeller(const Scene& scene);

  /// Ghosts ascend by `outside`. `peers`: who pushes them.
  void model(std::span<const BoundaryContact> border, const Surroundings& around, std::vector<GhostModel>& out,
             std::vector<GhostPeer>& peers);

 private:
  struct EffectiveMass {
    double mass_kg = 0.0;
    double heavy_kg = 0.0;  ///< of it, what gravity acts on
    double limit_n = 0.0;
    Vec3 inertial_n = Vec3::Zero();               ///< N, mass times acceleration
    Vec3 load_dependent_friction = Vec3::Zero();  ///< N/N
    bool wall = false;
    bool driven = false;  ///< a surface that moves pulls some of it
  };
  /// A contact of the ghost itself with what holds it back by friction.
  struct Hold {
    Vec3 outwards = Vec3::Zero();
    double impulse_n_s = 0.0;
    double friction = 0.0;
  };
  /// One ghost for each outside body of the border, ascending, and which of them only approach.
  void list(std::span<const BoundaryContact> border, const Membership& membership, std::vector<GhostModel>& out);
  /// The bodies that each ghost pushes along its axes.
  void find_pushed(std::span<const GhostModel> ghosts, const Surroundings& around);
  /// Driving force and friction limit of one axis, and the mass of the ghost if no axis gave it yet.
  void model_axis(std::uint32_t axis, const Surroundings& around, GhostModel& ghost, std::vector<GhostPeer>& peers);
  /// The pull of the users' devices, N, on what the last walk has found.
  struct Pulled {
    Vec3 by_springs = Vec3::Zero();
    Vec3 by_forces = Vec3::Zero();
  };
  /// Lists the springs.
  [[nodiscard]] Pulled find_peers(std::uint32_t axis, const Surroundings& around, const GhostModel& ghost,
                                  std::vector<GhostPeer>& peers) const;
  /// Fills the normals.
  void find_axes(std::span<const BoundaryContact> border, const ContactGraph& graph, GhostModel& ghost) const;
  /// Where a push `along` presses the body on something fixed, the way which that blocks; else `along`.
  [[nodiscard]] Vec3 support_direction(BodyId id, const Vec3& along, const ContactGraph& graph) const;
  /// A body that is pushed along, when the ghost `from` is.
  struct Pushed {
    BodyId body{};
    BodyId from{};
    Vec3 along = Vec3::Zero();
  };
  /// Lists what `from` pushes, itself first. False where something fixed is among it.
  bool push(BodyId from, const Vec3& along, const Surroundings& around);
  /// What a pushed body does to roll.
  struct Rolling {
    double mass_kg = 0.0;       ///< that turning it adds
    double resistance_n = 0.0;  ///< of what it rubs on as it turns
  };
  /// Nothing where it does not roll: not round that way, on no or more than one support, or sliding is easier.
  [[nodiscard]] std::optional<Rolling> rolling(BodyId id, const Vec3& along, const Surroundings& around) const;
  [[nodiscard]] EffectiveMass walk(BodyId from, const Vec3& along, const Surroundings& around);
  /// Ways across the axes in which the inside alone holds the outside become axes without friction of their own: what
  /// lies on a member goes with it at once, not as the world says a cycle later.
  void add_unconstrained_directions(const Motion& motion, const Surroundings& around, GhostModel& ghost);
  /// What a force on the ghost adds to the friction of `holds_`: contacts that face one way share what presses on them.
  [[nodiscard]] Vec3 load_dependent_friction() const;
  /// Whether the sub-world itself has the contacts of a ghost with this body.
  [[nodiscard]] bool in_engine(BodyId id, const Surroundings& around) const;
  [[nodiscard]] bool pushed_by_another(BodyId body, BodyId from, const Vec3& along) const;

  const Scene& scene_;
  CarriedModeller carried_;
  std::vector<BodyId> way_;                      ///< what a push moves, in the order of its discovery
  std::uint64_t walk_ = 0;                       ///< number of the present walk
  std::vector<std::uint64_t> in_way_, counted_;  ///< by body: the last walk that moved it, and that counted its mass
  std::vector<Hold> holds_;                      ///< of the present walk
  std::vector<Pushed> pushed_;                   ///< by all ghosts' axes, by body
  std::vector<BodyId> approaching_;              ///< ghosts that meet ghosts
};

/// The displacement, m, that takes a new ghost out of what it would penetrate: the world's gaps at the outside body,
/// corrected for how an inside body has moved against the outside one since. `offset_of` is that difference.
[[nodiscard]] Vec3 clearance(const GhostModel& ghost, std::span<const BoundaryContact> border,
                             const std::function<Vec3(BodyId)>& offset_of);

}  // namespace subworld
