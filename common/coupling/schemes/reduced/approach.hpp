#pragma once

#include "coupling/select/contact_graph.hpp"
#include "coupling/select/selection.hpp"
#include "coupling/select/swept_bounds.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <optional>
#include <span>
#include <vector>

namespace subworld {

/// Finds what does not touch a sub-world yet but may before it hears of it: the sub-world is ahead of the world, and
/// would run into a body, or push its ghosts into one, that the world tells it of only after the contact. What is found
/// may push on in turn. A body that hangs by contacts on one that touches the inside, or is found, goes with that one;
/// but where it is to be pushed into something, it is at the border itself, with all that lies between.
///
/// For each sub-world: `begin`; `inside` for its members; `touching`; then, for as long as `find` names a place, what
/// there is by `outside`.
class ApproachFinder {
 public:
  explicit ApproachFinder(const Scene& scene);

  /// `time_s`: time until the sub-world receives its next frame.
  void begin(double time_s);
  /// A member.
  void inside(BodyId id, const BodyState& state, const Box& bounds);
  /// `contacts` are the border's, `graph` that of all the world's. Returns the outside bodies that touch the inside and
  /// those that contacts attach to them; each is to be listed by `ghost`, which returns the bounds of all places that
  /// it may reach.
  std::span<const BodyId> touching(const Membership& membership, const ContactGraph& graph,
                                   std::span<const BoundaryContact> contacts);
  Box ghost(BodyId id, const BodyState& state, const Box& bounds);
  /// A body that `may_come`, and does so if it gets to `where`.
  void outside(BodyId id, const BodyState& state, const Box& bounds, const Box& where);
  [[nodiscard]] bool may_come(BodyId id) const;

  /// Adds to `border`, which holds the contacts, pairs that may become ones, without impulses. Their normals are those
  /// of the faces, or the line between the centres, that part them most. The contacts by which what hangs is pushed
  /// into something are added as well. Returns where to look for what they may meet.
  std::optional<Box> find(const Membership& membership, const ContactGraph& graph,
                          std::vector<BoundaryContact>& border);

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
    Vec3 normal = Vec3::UnitZ();  ///< towards the first body
    double distance = 0.0;        ///< m
  };
  enum class Place : std::uint8_t { apart, hanging, found, touching, inside };

  [[nodiscard]] Mover mover(BodyId id, const BodyState& state, const Box& bounds) const noexcept;
  void put(BodyId id, Place place);
  /// What hangs by contacts on the linked bodies from `first` on goes with them.
  void attach(std::size_t first, const Membership& membership, const ContactGraph& graph);
  [[nodiscard]] double reach_m(const Mover& mover, const Vec3& along) const;
  [[nodiscard]] Gap gap_along(Vec3 normal, const Mover& one, const Mover& other) const;
  /// Whether the pair's first body, if it is attached, is pushed towards the second by the body it is attached to.
  [[nodiscard]] bool pushed(const BoundaryContact& pair, const ContactGraph& graph) const;
  /// Takes an attached body, and those between it and the body it is attached to, to the border.
  void unhang(BodyId hanging, const ContactGraph& graph, std::vector<BoundaryContact>& border);
  /// The pair, if it may become a contact.
  [[nodiscard]] std::optional<BoundaryContact> meet(const Mover& pusher, const Mover& other) const;

  const Scene& scene_;
  double time_s_ = 0.0;
  std::vector<Mover> pushers_;  ///< members, then ghosts, then what has been found
  std::size_t done_ = 0;        ///< of the pushers
  std::size_t contacts_ = 0;    ///< of the border, before anything was found
  std::size_t found_ = 0;       ///< bodies that were apart
  std::vector<Mover> near_;
  std::vector<BodyId> touched_;       ///< whose place or `listed_` may be another than at the start
  std::vector<Place> places_;         ///< by body
  std::vector<std::uint32_t> hooks_;  ///< by body: the contact by which it hangs
  std::vector<bool> listed_;          ///< by body: it is in `near_`
  std::vector<BodyId> linked_;  ///< touching bodies, then attached ones, then found ones and those attached to them
};

}  // namespace subworld
