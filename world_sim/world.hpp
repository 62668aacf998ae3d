#pragma once

#include "coupling/contact_graph.hpp"
#include "coupling/ratio_control.hpp"
#include "coupling/scheme.hpp"
#include "coupling/suppression.hpp"
#include "coupling/synchroniser.hpp"
#include "coupling/timetable.hpp"
#include "coupling/tool.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "physics/contact_totals.hpp"
#include "physics/engine_exchange.hpp"
#include "physics/resting_engine.hpp"
#include "world_sim/frame_maker.hpp"

#include <functional>
#include <memory>
#include <vector>

namespace subworld {

/// What can be seen of the world at one stamp.
struct WorldView {
  double stamp_s = 0.0;
  double real_time_factor = 1.0;
  std::vector<BodyState> states;  ///< by body id
  std::vector<UserView> users;
};

/// The truth: every body, and for each user the membership of the sub-world, its border and the merge.
/// A cycle is `receive` (any number of reports), `step`, then `frame` of each user.
class World {
 public:
  /// Creates all bodies; `progress` is called with the part done, 0 .. 1. Throws `Error` (usage) for an engine or
  /// scheme that does not exist.
  explicit World(const Scene& scene, const std::function<void(double)>& progress = {},
                 const EngineMaker& make = make_engine);

  /// Lets the world come to rest before t = 0, every proxy held by its coupling at its start pose. `progress` is called
  /// with the part done, 0 .. 1; returns early, false, when it returns false.
  bool settle(const std::function<bool(double)>& progress);

  /// Keeps a report until the world reaches its stamp; one of the past is used late. Returns false for one that is too
  /// old, too far ahead or of a user that does not exist. The caller gets an older report for it, so that a reader need
  /// not allocate for the next one.
  bool receive(HapticReport&& report);

  /// Applies the blends that are due, drives the proxies and simulates [jT, (j+1)T): `synchronise`, `simulate`,
  /// `account` and `make_frames`, for who does not time them.
  void step();

  /// Whether the frame of the present stamp is to be sent: its user's sub-world waits for it.
  [[nodiscard]] bool tells(std::size_t user) const noexcept { return !users_[user].suppression.lacks_frame(stamp_); }
  /// Whether the report of this stamp is here and not used yet, or will not come.
  [[nodiscard]] bool has_report(std::size_t user, std::uint64_t stamp) const noexcept {
    return users_[user].holds(stamp) || users_[user].suppression.lacks_report(stamp);
  }

  /// The stamp of the newest report that the next step uses if it is there.
  [[nodiscard]] std::uint64_t wants() const noexcept { return stamp_ + scheme_.properties.lead_cycles; }

  /// Applies the blends that are due; on its own for the reports that arrive after the last step.
  void synchronise();
  /// Drives the proxies and simulates the cycle.
  void simulate();
  /// Hash, energies and motions of the present stamp.
  void account();
  /// Makes every user's frame of the present stamp.
  void make_frames();

  /// Adds the final states to the hash.
  void close() { account(); }

  /// Asks for another engine. Returns what came of it, in words; exchange_engine() hands over between two steps,
  /// when the other one is ready.
  std::string change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);

  /// What the last cycle took, by the caller's clock: corrects what the world is thought to cost. Without it, published
  /// costs count, and runs repeat bit by bit.
  void took(double cost_s) noexcept { correction_.observe(published_cost_s(cycle_s_, substeps_), cost_s); }

  /// The world at the present stamp as user u sees it; new after each step().
  [[nodiscard]] WorldFrame& frame(std::size_t user) { return frames_.frame(user, stamp_); }
  /// The border of user u's sub-world, at the present stamp.
  [[nodiscard]] const std::vector<BoundaryContact>& border(std::size_t user) const noexcept {
    return frames_.border(user);
  }
  /// How user u's sub-world was chosen, at the present stamp.
  [[nodiscard]] SelectionFacts selection(std::size_t user) const noexcept { return frames_.selection(user); }
  [[nodiscard]] SceneDescription description(std::uint64_t settings_hash) const;
  /// Allocates only until the view has grown to the world.
  void look(WorldView& view) const;

  [[nodiscard]] std::uint64_t stamp() const noexcept { return stamp_; }
  [[nodiscard]] double time_s() const noexcept { return seconds(timetable_.start(stamp_)); }
  /// Whether the duration of the scene is over, to the nearest cycle.
  [[nodiscard]] bool over() const noexcept {
    return time_s() + 0.5 * seconds(static_cast<std::uint64_t>(timetable_.ratio(stamp_))) > scene_.settings.duration_s;
  }
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }
  /// Of the cycle that ended last.
  [[nodiscard]] double cycle_s() const noexcept { return cycle_s_; }
  [[nodiscard]] int ratio() const noexcept {
    return stamp_ == 0 ? scene_.settings.ratio : timetable_.ratio(stamp_ - 1);
  }
  [[nodiscard]] std::uint64_t ratio_changes() const noexcept { return ratio_changes_; }
  [[nodiscard]] std::size_t asleep() const noexcept { return engine_.asleep_count(); }
  [[nodiscard]] const Engine& engine() const noexcept { return engine_; }
  [[nodiscard]] const Scheme& scheme() const noexcept { return scheme_; }
  /// Steps of the engine in the last cycle.
  [[nodiscard]] int substeps() const noexcept { return substeps_; }
  /// Length of the parts in which the engine integrated.
  [[nodiscard]] double integration_substep_s() const { return engine_.integration_substep_s(cycle_s_ / substeps_); }
  [[nodiscard]] std::size_t user_count() const noexcept { return users_.size(); }
  /// Chained over the states of all bodies after every cycle: equal runs have equal hashes.
  [[nodiscard]] std::uint64_t state_hash() const noexcept { return hash_; }
  /// Energy that the bodies have lost so far, but for the proxies' motion after the start, J: most that they can have
  /// given to operators.
  [[nodiscard]] double released_j() const noexcept { return released_j_; }
  /// What lifts every body by as much as engines let contacts overlap, J.
  [[nodiscard]] double contact_slack_j() const;
  /// Most that the energy rose above its start plus the work of the devices, so far, J.
  [[nodiscard]] double energy_excess_j() const noexcept { return energy_excess_j_; }
  [[nodiscard]] double kinetic_energy_j() const noexcept { return kinetic_j_; }
  [[nodiscard]] double potential_energy_j() const noexcept { return potential_j_; }
  /// False once a body's state is not finite.
  [[nodiscard]] bool finite() const noexcept { return finite_; }

 private:
  static constexpr double kTracking = 0.05;  ///< of what a cycle costs, in a cycle

  struct User {
    const UserSpec* spec = nullptr;
    double rate = 1.0;  ///< of the haptic clock in the cycle that the world simulates
    Tool tool;          ///< at that rate
    std::unique_ptr<Synchroniser> synchroniser;
    std::vector<HapticReport> inbox;  ///< by stamp
    std::vector<bool> waiting;        ///< inbox holds a report that is not used yet
    HapticReport report;              ///< newest used
    HapticReport before;              ///< the one used before it
    bool heard = false;
    SuppressedCycles suppression{0};

    [[nodiscard]] bool holds(std::uint64_t stamp) const noexcept {
      const std::size_t slot = stamp % inbox.size();
      return waiting[slot] && inbox[slot].stamp == stamp;
    }
    /// The report of a stamp, or the one that ends the suppression in which it lies, or the newest used.
    [[nodiscard]] const HapticReport& at(std::uint64_t stamp) const noexcept {
      while (suppression.lacks_report(stamp)) ++stamp;
      return holds(stamp) ? inbox[stamp % inbox.size()] : report;
    }
  };

  void apply(std::size_t user, const HapticReport& report);
  void drive_proxies(double until_s, double dt);
  /// The proxy's dynamics at the rate of the haptic clock.
  void set_rate(User& user, double rate);
  void hold(const User& user, const DevicePose& target, const ForceLimits& limits, double dt);
  /// By how much the world's positions are ahead of the sub-worlds' where both account for the same forces: half the
  /// difference of their steps. Frames tell what a sub-world of the same forces would have.
  [[nodiscard]] double half_step_offset_s() const;
  [[nodiscard]] double seconds(std::uint64_t haptic_steps) const noexcept {
    return scene_.settings.h_s * static_cast<double>(haptic_steps);
  }
  /// What a cycle costs by the published coefficients of the engine, s.
  [[nodiscard]] double published_cost_s(double cycle_s, int parts) const noexcept;
  /// Whether forces across the border are felt, or may before a change of the ratio takes effect.
  [[nodiscard]] bool border_is_felt(std::size_t user);
  void begin_cycle();
  /// Lets sleep what rests and wakes what may be reached before the next look, after `dt` of simulation.
  void rest(double dt);
  void count_asleep(BodyId id);
  /// By its motion, J.
  [[nodiscard]] double potential_j(BodyId id) const noexcept;
  /// For how long a sub-world may act before the world looks again.
  [[nodiscard]] double horizon_s() const;
  void plan_ratio();
  void simulate_cycle();
  /// With friction where somebody reads it.
  [[nodiscard]] std::span<const Contact> contacts_of_step();
  /// Of the last step's contacts, if they lack it; false if not.
  bool find_friction();
  void balance();

  const Scene& scene_;
  const Scheme& scheme_;
  std::unique_ptr<WorldSide> side_;  ///< of the scheme
  LiveEngine live_;
  RestingEngine engine_;
  std::vector<User> users_;
  std::uint64_t stamp_ = 0;
  std::uint64_t hash_;
  std::uint64_t remembered_;
  Timetable timetable_;
  RatioControl ratio_control_;
  std::uint64_t ratio_changes_ = 0;  ///< planned
  EngineCost engine_cost_;           ///< of the engine in use
  EngineSettings next_engine_;       ///< that was asked for
  CostCorrection correction_{kTracking};
  CycleCost cycle_cost_;
  double cycle_s_;  ///< of the last cycle, or the one under way
  int substeps_ = 1;
  std::vector<BodyId> near_;
  ContactTotals totals_;               ///< of the sub-steps
  std::vector<Contact> settled_;       ///< as if the last step of settling had been a cycle
  std::span<const Contact> contacts_;  ///< of the last cycle
  bool reads_friction_;                ///< somebody may
  bool reads_friction_later_;          ///< and knows only when the step is over
  bool lacks_friction_ = false;        ///< contacts_ does
  ContactGraph graph_;
  std::vector<Motion> motions_;  ///< by body, in the last cycle
  FrameMaker frames_;
  std::vector<Heard> heard_;      ///< by user, while frames are made
  std::vector<double> energy_j_;  ///< kinetic and potential, by stamp
  double start_energy_j_ = 0.0;
  double kinetic_j_ = 0.0;
  double potential_j_ = 0.0;
  double resting_j_ = 0.0;  ///< of what sleeps
  double energy_excess_j_ = 0.0;
  double released_j_ = 0.0;
  double of_bodies_j_ = 0.0;  ///< kinetic and potential, without the proxies' motion
  bool finite_ = true;
};

}  // namespace subworld
