#pragma once

#include "coupling/select/contact_graph.hpp"
#include "coupling/select/peers.hpp"
#include "model/body.hpp"
#include "model/mechanisms.hpp"
#include "model/scene/scene.hpp"
#include "model/step_cost.hpp"

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace subworld {

/// What a haptic step may cost, and what its parts cost.
struct Budget {
  double limit_s = 0.0;
  StepCost cost;
  bool simulates_border = false;  ///< outside bodies that touch members are simulated as well, as ghosts
};

/// Corrects published costs by what steps were seen to take. A step that the machine held up moves it by no more than
/// any other, so it follows the median; and it is taken over only when it has moved by enough to matter.
class CostCorrection {
 public:
  /// `tracking`: by which part an observation moves the factor, at most.
  explicit CostCorrection(double tracking = 0.01) noexcept : tracking_(tracking) {}

  /// `expected_s`: of a haptic step by the published costs; `seen_s`: what one took.
  void observe(double expected_s, double seen_s) noexcept;
  /// By which costs are to be multiplied.
  [[nodiscard]] double factor() const noexcept { return factor_; }

 private:
  double tracking_;
  double tracked_ = 1.0;
  double factor_ = 1.0;
};

/// Takes into a sub-world the bodies that matter most to the operator and fit into a budget (paper 4.4).
///
/// Importance: the operator feels a body through the contacts between the proxy and it. The importance of the proxy
/// is 1. Each body shares its importance w among its neighbours by what they would put at the border:
///     w(b) = max over neighbours a of w(a) l_ab / sum over all neighbours c of a of l_ac.
/// There, l_ab is the sum of load + m_b g over the contact points of a and b. A body that no contact joins to the proxy
/// counts by how near it is, and so little that any contact comes first. The proxy of another user, who may press with
/// any force, counts as much as the body that it touches.
///
/// What fits: a mechanism enters with its first body, as a whole. Bodies enter by importance, until the next one would
/// cost too much. Present members count more than others and may stay while the cost is a little above the limit, so
/// that noise in the loads exchanges nobody.
class BudgetSelector {
 public:
  explicit BudgetSelector(const Scene& scene);

  /// Keeps those of `members` that fit; ascending, movable, with whole mechanisms; the proxy is one of them and stays.
  /// `present` are the members so far; `graph` holds impulses over `step_s`; `peers`: see PeerFinder.
  void limit(BodyId proxy, std::span<const BodyId> present, const ContactGraph& graph, double step_s,
             std::span<const PeerContact> peers, const std::function<Box(BodyId)>& bounds, const Budget& budget,
             std::vector<BodyId>& members);

  [[nodiscard]] Mechanisms& mechanisms() noexcept { return mechanisms_; }

  /// What the step of the chosen ones costs by the coefficients, s.
  [[nodiscard]] double cost_s() const noexcept { return cost_s_; }
  [[nodiscard]] std::size_t omitted() const noexcept { return omitted_; }

 private:
  /// What is known of a body during a selection.
  struct Standing {
    double importance = 0.0;
    bool candidate = false;
    bool joined = false;  ///< to a member, by joints
    bool present = false;
    bool member = false;
    bool ghost = false;  ///< touches a member, and is simulated for that
  };
  struct Offer {
    double importance = 0.0;  ///< with the bonus of who is present
    BodyId id{};
  };
  struct Size {
    std::size_t bodies = 0;
    std::size_t contacts = 0;
  };
  static bool before(const Offer& a, const Offer& b) noexcept;
  [[nodiscard]] Standing& standing(BodyId id);
  void offer(BodyId id, double importance);
  void spread(BodyId from, double importance, const ContactGraph& graph, double step_s);
  /// What a step has to simulate once `id` is a member as well. Lists the ghosts that this makes.
  [[nodiscard]] Size with(BodyId id, Size size, const ContactGraph& graph, bool simulates_border);

  const Scene& scene_;
  Mechanisms mechanisms_;
  double gravity_m_s2_;
  std::vector<Standing> standings_;  ///< by body; between calls as they were made
  std::vector<BodyId> touched_;      ///< whose standings are not
  std::vector<Offer> offers_;        ///< a heap, the most important first
  std::vector<BodyId> new_ghosts_;
  double cost_s_ = 0.0;
  std::size_t omitted_ = 0;
};

}  // namespace subworld
