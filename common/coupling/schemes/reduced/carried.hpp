#pragma once

#include "coupling/select/contact_graph.hpp"
#include "coupling/select/selection.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace subworld {

using Vec6 = Eigen::Matrix<double, 6, 1>;  ///< of a twist or a wrench: the linear part, then the angular one
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// Finds the outside bodies that nothing but the inside holds: those from which no chain of outside contacts leads to
/// something fixed. What such a body carries goes with it as one rigid body. Ghosts that carry a body together share
/// its mass as they share its load: a body at k contacts from the nearest ghost belongs to those of its neighbours at k
/// - 1 contacts, in proportion to the impulses between them.
class CarriedModeller {
 public:
  explicit CarriedModeller(const Scene& scene);

  /// Finds who carries what. `ghosts` ascend; `graph` is that of the world's contacts.
  void begin(std::span<const GhostModel> ghosts, const Membership& membership, const ContactGraph& graph);
  /// Nothing where something else holds the body, which is one of the ghosts.
  [[nodiscard]] std::optional<CarriedBody> model(BodyId outside,
                                                 const std::function<BodyState(BodyId)>& state_of) const;

 private:
  enum class Hold : std::uint8_t { unknown, inside, held };
  struct Share {
    BodyId body{};
    BodyId ghost{};  ///< that carries this part of its mass
    double part = 1.0;
  };

  /// Whether the inside alone holds the outside bodies that hang together with this one.
  bool only_inside_holds(BodyId outside, const Membership& membership, const ContactGraph& graph);
  void share_next(std::size_t from, std::size_t to, const Membership& membership, const ContactGraph& graph);

  const Scene& scene_;
  std::vector<Hold> holds_;            ///< by body
  std::vector<BodyId> seen_;           ///< whose hold is known
  std::vector<BodyId> carried_;        ///< ghosts first, then ever farther from them
  std::vector<std::uint32_t> layers_;  ///< by body: contacts from the nearest ghost, plus one; 0: not carried
  std::vector<Share> shares_;          ///< in the order of `carried_`
  std::vector<std::uint32_t> begins_;  ///< by body: its first share
};

/// Whether a body can be part of the whole that is said to carry it along: no whole is lighter or easier to turn.
[[nodiscard]] bool holds(const CarriedBody& whole, const Body& body);

/// A carried ghost while it runs. An engine knows the outside body alone; what is attached to it follows here: a step
/// begins so that it ends as the whole would, if the inside presses as in the step before. That is stable, because no
/// whole is lighter than its part.
struct CarriedMotion {
  Mat6 mobility = Mat6::Zero();  ///< inverse of the spatial inertia of the whole, about the outside body's centre
  Vec6 drive = Vec6::Zero();     ///< N, N m
  Vec6 velocity = Vec6::Zero();  ///< of the whole at the outside body's centre, m/s, rad/s
  Vec6 impulse = Vec6::Zero();   ///< of the inside on it, in the last step, N s, N m s

  void follow(const CarriedBody& whole);
  /// The velocity with which the outside body, alone, begins the step.
  [[nodiscard]] Vec6 begin(const Body& body, const Quat& orientation, double dt) const;
  /// After the step, with the velocity it began and ended with.
  void end(const Body& body, const Quat& orientation, const Vec6& before, const Vec6& after, double dt);
};

}  // namespace subworld
