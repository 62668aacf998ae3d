#pragma once

#include "coupling/schemes/scheme.hpp"
#include "coupling/select/budget.hpp"
#include "coupling/select/contact_graph.hpp"
#include "coupling/select/peers.hpp"
#include "coupling/select/selection.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "world_sim/suppression_finder.hpp"
#include "world_sim/user_link.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// How a user's sub-world was chosen.
struct SelectionFacts {
  std::size_t omitted = 0;   ///< of the box's bodies, for the budget
  double expected_s = 0.0;   ///< of a haptic step, by the published costs
  double cost_factor = 1.0;  ///< by which steps were seen to cost more
};

/// Makes each user's frame of the world: who belongs to the sub-world, what is at its border, and the states that it
/// needs.
class FrameMaker {
 public:
  FrameMaker(const Scene& scene, const Scheme& scheme, WorldSide& side, std::uint64_t remembered_cycles);

  /// Makes the frames of one stamp. `links` by user; the published states are moved by `offset_s` (may be negative).
  void make(const WorldNow& now, std::span<const UserLink> links, double offset_s);

  /// The joint has broken: it is in the frames from now on.
  void break_joint(std::size_t joint) {
    budget_.mechanisms().break_joint(joint);
    broken_joints_.push_back(static_cast<std::uint32_t>(joint));
  }
  [[nodiscard]] std::span<const std::uint32_t> broken_joints() const noexcept { return broken_joints_; }

  /// Whether forces across a border are felt, or may be within `until_s` of simulated time: by the frames of the stamp
  /// before.
  [[nodiscard]] bool border_is_felt(const WorldNow& now, double until_s);
  [[nodiscard]] std::uint64_t remembered() const noexcept { return remembered_; }  ///< cycles

  /// What a haptic step of a user took, mean over a cycle; 0: not known. Corrects what bodies are thought to cost.
  void observe_step(std::size_t user, double mean_s) noexcept {
    User& of = users_[user];
    of.correction.observe(of.selection.expected_s, mean_s);
    of.selection.cost_factor = of.correction.factor();
  }

  /// Of a stamp that is remembered.
  [[nodiscard]] WorldFrame& frame(std::size_t user, std::uint64_t stamp) {
    return users_[user].frames[stamp % users_[user].frames.size()];
  }
  /// At the newest stamp.
  [[nodiscard]] const Border& border(std::size_t user) const noexcept { return users_[user].border; }
  [[nodiscard]] const Membership& membership(std::size_t user) const noexcept { return users_[user].membership; }
  [[nodiscard]] const SelectionFacts& selection(std::size_t user) const noexcept { return users_[user].selection; }
  /// How many sub-worlds hold a body.
  [[nodiscard]] int holders(BodyId id) const noexcept { return holders_[index(id)]; }

 private:
  struct User {
    const UserSpec* spec = nullptr;
    std::vector<PeerContact> felt;  ///< of the other users whom this one may feel
    double outside_work_j = 0.0;    ///< see WorldFrame
    Membership membership;
    Border border;
    Budget budget;
    CostCorrection correction;
    SelectionFacts selection;
    std::vector<WorldFrame> frames;                 ///< by stamp
    std::vector<std::vector<OutsideBody>> outside;  ///< by stamp
    std::vector<BodyId> near;                       ///< what the proxy may reach within `near_for_s`
    double near_for_s = kNever_s;
  };
  static constexpr double kNever_s = -1.0;

  /// A new stamp for the peers.
  void begin_peers(const WorldNow& now, std::span<const UserLink> links);
  /// What the proxy of a user may reach within the time.
  const std::vector<BodyId>& near(User& user, const WorldNow& now, double horizon_s);
  /// Finds the other users that this one may feel; adds to `bodies` what the sub-world needs for them.
  void find_peers(User& user, const WorldNow& now, double horizon_s, std::vector<BodyId>& bodies);
  /// Fills the membership; returns where its members may get within the time.
  Box select(User& user, const WorldNow& now, double horizon_s);
  void list_peers(const User& user, const WorldNow& now, std::span<const UserLink> links, WorldFrame& frame) const;
  /// Adds what connected users did in the last cycle whose devices do not move their proxies in the sub-world.
  void count_outside_work(User& user, WorldFrame& frame) const;
  /// What the bodies that contacts connect to the proxy may give back, and what they have lost.
  void count_energy(User& user, const WorldNow& now, WorldFrame& frame);
  void note_work(std::span<const UserLink> links);
  void list_unconfirmed(const User& user, const WorldNow& now, const UserLink& link, double offset_s,
                        WorldFrame& frame);
  void tell_border(const User& user, const WorldNow& now, const UserLink& link, WorldFrame& frame);
  /// The oldest frame of those after which the sub-world may not know of a body, at most the present one.
  [[nodiscard]] std::uint64_t first_unconfirmed(const WorldNow& now, const UserLink& link) const noexcept;
  [[nodiscard]] double horizon_s(const WorldNow& now, const UserLink& link) const;

  const Scene& scene_;
  const Scheme& scheme_;
  std::uint64_t remembered_;
  std::vector<User> users_;
  WorldSide& side_;
  PeerFinder peers_;
  std::vector<BodyId> proxies_;        ///< by user
  std::vector<std::uint8_t> user_of_;  ///< by body, of which it is the proxy
  std::vector<std::uint8_t> holders_;  ///< by body: sub-worlds that hold it
  std::vector<bool> visited_;          ///< by body, in a walk through contacts
  BudgetSelector budget_;
  std::vector<std::uint32_t> broken_joints_;
  bool tells_all_pairs_;
  std::vector<UserPull> pulls_;               ///< on proxies
  std::vector<double> operators_j_, work_j_;  ///< by user: work of the operator, since the start and in the last cycle
  SuppressionFinder suppression_;
  bool may_suppress_;
  bool sends_changes_;
  std::vector<BodyId> scratch_, before_;
  std::vector<Contact> contacts_;  ///< of the members
};

}  // namespace subworld
