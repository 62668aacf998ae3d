#pragma once

#include "coupling/contact_graph.hpp"
#include "coupling/selection.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Finds what does not touch a sub-world yet but may before it hears of it: the sub-world is ahead of the world, and
/// would run into a body that the world tells it of only after the contact. A sub-world is described by `begin`,
/// `inside` for its members and `outside` for movable bodies that are near.
class ApproachFinder {
 public:
  explicit ApproachFinder(const Scene& scene);

  /// `time_s`: for which the sub-world will know no more than it is told now.
  void begin(double time_s);
  /// The bounds of all places that the member may reach.
  Box inside(BodyId id, const BodyState& state, const Box& bounds);
  void outside(BodyId id, const BodyState& state, const Box& bounds);

  /// Adds to `border`, which holds the contacts, pairs that may become ones, without impulses. Their normals are those
  /// of the faces, or the line between the centres, that part them most. A body that hangs by contacts of `graph`, the
  /// world's, on one that touches the inside already is left out: it goes with that one.
  void find(const Membership& membership, const ContactGraph& graph, std::vector<BorderPair>& border);

 private:
  struct Mover {
    BodyId id{};
    BodyState state;
    Box bounds;
    double any_way_m = 0.0;  ///< how far it may get beside its present way: by turning and by falling
    double travel_m = 0.0;   ///< how far at all

    [[nodiscard]] Box swept() const noexcept;
  };
  /// What parts two bodies along one direction.
  struct Gap {
    Vec3 normal = Vec3::UnitZ();  ///< towards the inside body
    double distance = 0.0;        ///< m
  };

  [[nodiscard]] Mover mover(BodyId id, const BodyState& state, const Box& bounds) const noexcept;
  [[nodiscard]] double reach_m(const Mover& mover, const Vec3& along) const;
  [[nodiscard]] Gap gap_along(Vec3 normal, const Mover& in, const Mover& out) const;
  /// Adds the pair if it may become a contact.
  void meet(const Mover& in, const Mover& out, std::vector<BorderPair>& border) const;
  /// Takes from what is near all that hangs on a body that touches the inside.
  void leave_what_hangs(const Membership& membership, const ContactGraph& graph, std::span<const BorderPair> contacts);

  const Scene& scene_;
  double time_s_ = 0.0;
  std::vector<Mover> inside_;
  std::vector<Mover> outside_;
  std::vector<bool> touches_;    ///< by body
  std::vector<bool> hangs_;      ///< by body
  std::vector<BodyId> hanging_;  ///< in the order of their discovery, what touches first
};

}  // namespace subworld
