#pragma once

#include "coupling/contact_graph.hpp"
#include "coupling/energy_port.hpp"
#include "coupling/impulse_account.hpp"
#include "coupling/ratio_control.hpp"
#include "coupling/scheme.hpp"
#include "coupling/shared_islands.hpp"
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
#include <optional>
#include <string_view>
#include <vector>

namespace subworld {

struct WorldCheckpoint;

/// What can be seen of the world at one stamp.
struct WorldView {
  double stamp_s = 0.0;
  double real_time_factor = 1.0;
  std::vector<BodyState> states;  ///< by body id
  std::vector<UserView> users;
};

/// Stages of a cycle of the world process. World::step() consists of `synchronise` to `extract`.
enum class WorldStage : std::uint8_t {
  wake,
  receive,
  decode,
  control,
  synchronise,  ///< applies the blends that are due
  simulate,     ///< drives the proxies and simulates [jT, (j+1)T)
  account,      ///< hash, energies and motions of the new stamp
  extract,      ///< makes every user's frame of the new stamp
  send,
  display,
  count
};

/// The world at the present stamp, in numbers.
struct WorldFacts {
  std::string_view engine;  ///< name of the engine in use
  std::uint64_t stamp = 0;
  double time_s = 0.0;
  bool over = false;                ///< the duration of the scene is over, to the nearest cycle
  double cycle_s = 0.0;             ///< length of the last cycle
  int ratio = 1;                    ///< haptic steps in the last cycle
  int substeps = 1;                 ///< steps of the engine in the last cycle
  std::uint64_t ratio_changes = 0;  ///< planned so far
  /// Chained over the states of all bodies after every cycle: equal runs have equal hashes.
  std::uint64_t state_hash = 0xcbf29ce484222325ULL;
  bool finite = true;  ///< false once a body's state is not finite
  double kinetic_j = 0.0;
  double potential_j = 0.0;
  double energy_excess_j = 0.0;  ///< largest rise of the energy above its start plus the work of the devices, so far
  /// Energy that the bodies have lost so far, but for the proxies' motion after the start: most that they can have
  /// given to operators.
  double released_j = 0.0;
  /// Taken by all operators together from what none of them had put in (coupling/energy_port).
  double operators_created_j = 0.0;
};

/// A user's sub-world at the present stamp.
struct UserFacts {
  bool waits_for_frame = true;              ///< the frame of this stamp is to be sent
  std::span<const BoundaryContact> border;  ///< contacts with bodies outside, and what may become one
  SelectionFacts selection;
  Wrench impulse;                  ///< of the user on the proxy that has been passed on to the world, since the start
  std::uint64_t newest_stamp = 0;  ///< of the newest report received
  bool absent = false;             ///< the world holds the proxy, and uses no report that has not seen that
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
  /// Instead of settle(), for a world of resumed_scene(): goes on at the checkpoint's stamp, with its accounts. The
  /// users' accounts begin there.
  void resume(const WorldCheckpoint& from);

  /// Keeps a report until the world reaches its stamp; one of the past is used late. Returns false for one that is too
  /// old, too far ahead or of a user that does not exist. The caller gets an older report for it, so that a reader need
  /// not allocate for the next one.
  bool receive(HapticReport&& report);
  /// Whether the report of this stamp is here and not used yet, or will not come.
  [[nodiscard]] bool has_report(std::size_t user, std::uint64_t stamp) const noexcept {
    return users_[user].holds(stamp) || users_[user].suppression.lacks_report(stamp);
  }

  /// Reports of the user do not come: from now on, until the next one, the coupling holds the proxy, with the wrench
  /// that the user exerted last. So nothing falls that was held, and nothing is pushed on.
  void hold(std::size_t user);
  /// Before the first cycle: the user is absent until a sub-world reports that has started from a frame of this stamp
  /// or a later one.
  void begin_without(std::size_t user);
  /// The user is absent from now on, until reports come of a sub-world that has started from a frame of a later stamp.
  /// Meanwhile the coupling holds the proxy.
  void leave(std::size_t user);

  /// A cycle. `on_stage(WorldStage)` is called after each of its stages.
  template <class OnStage = void (*)(WorldStage)>
  void step(OnStage&& on_stage = [](WorldStage) {}) {
    synchronise();
    on_stage(WorldStage::synchronise);
    simulate();
    on_stage(WorldStage::simulate);
    account();
    on_stage(WorldStage::account);
    make_frames();
    on_stage(WorldStage::extract);
  }
  /// What the last cycle took, by the caller's clock: corrects what the world is thought to cost. Without it, published
  /// costs count, and runs repeat bit by bit.
  void took(double cost_s) noexcept { correction_.observe(published_cost_s(facts_.cycle_s, facts_.substeps), cost_s); }
  /// After the last cycle: applies the reports that have arrived since, and adds the final states to the hash.
  void close();

  /// Asks for another engine. Returns what came of it; exchange_engine() hands over between two steps,
  /// when the other one is ready.
  OrderAnswer change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);
  /// Narrows the bounds between which the simulation ratio adapts: `text` as in "4" or "4-8". Refused outside the
  /// scene's bounds, for which all programs have made room.
  OrderAnswer change_ratio(const std::string& text);

  [[nodiscard]] const WorldFacts& facts() const noexcept { return facts_; }
  [[nodiscard]] UserFacts user_facts(std::size_t user) const noexcept;
  /// The world at the present stamp as user u sees it; new after each step().
  [[nodiscard]] WorldFrame& frame(std::size_t user) { return frames_.frame(user, facts_.stamp); }
  /// Where the user's coupling is held that exerts the wrench of the last cycle on the proxy at rest.
  [[nodiscard]] Pose device(std::size_t user) const;
  /// Allocates only until the view has grown to the world.
  void look(WorldView& view) const;
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }
  [[nodiscard]] const RestingEngine& engine() const noexcept { return engine_; }

 private:
  static constexpr double kTracking = 0.05;  ///< of what a cycle costs, in a cycle

  /// What a report counts since the start.
  struct Totals {
    Wrench impulse;
    double device_work_j = 0.0, operator_work_j = 0.0;
  };
  struct User {
    const UserSpec* spec = nullptr;
    double rate = 1.0;  ///< of the haptic clock in the cycle that the world simulates
    Tool tool;          ///< at that rate
    std::unique_ptr<Synchroniser> synchroniser;
    std::vector<HapticReport> inbox;  ///< by stamp
    std::vector<bool> waiting;        ///< inbox holds a report that is not used yet
    HapticReport report;              ///< newest used
    HapticReport before;              ///< the one used before it
    std::uint64_t newest_stamp = 0;   ///< of those received, used or not
    bool heard = false;
    bool counted = false;             ///< a report has come
    std::optional<DevicePose> held;   ///< where its device is held, while no report is used
    bool absent = false;              ///< no report has come of a sub-world that has started anew
    std::uint64_t joins_from = 0;     ///< oldest frame from which the sub-world of an absent user has to start anew
    std::uint64_t started_stamp = 0;  ///< of the frame from which its sub-world has started
    std::optional<std::uint64_t> joins_at;  ///< stamp of its first report since, which has come and is not used yet
    Totals before_join;  ///< added to those of reports: a process that joins counts from its own start
    ImpulseAccount impulse;
    Wrench mean;  ///< of the user in the cycle under way
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
    [[nodiscard]] const HapticReport& before_that(const HapticReport& now) const noexcept {
      return &now == &report ? before : report;
    }
  };

  void synchronise();
  void simulate();
  /// Takes over what the sub-worlds say of islands that they share.
  void merge_shared();
  void account();
  void make_frames();
  void apply(std::size_t user, const HapticReport& report);
  /// In a resumed world: the coupling holds the proxy from there, with energy of before.
  void hold_at(User& user, const Pose& device);
  /// The first report of a sub-world that has started anew has come. The coupling holds the proxy until two have been
  /// used: their difference is what the user does now.
  void begin_join(std::size_t user, const HapticReport& report);
  void end_join(User& user);
  /// The first report to this world: of a sub-world that has counted before, for a world that has died.
  static void begin_count(User& user, const HapticReport& report) noexcept;
  /// Passes the users' impulses on to the cycle under way.
  void pass_impulses();
  void drive_proxies(double until_s, double dt);
  /// The proxy's dynamics at the rate of the haptic clock.
  void set_rate(User& user, double rate);
  void pull(const User& user, const DevicePose& target, const ForceLimits& limits, double dt);
  /// By how much the world's positions are ahead of the sub-worlds' where both account for the same forces: half the
  /// difference of their steps. Frames tell what a sub-world of the same forces would have.
  [[nodiscard]] double half_step_offset_s() const;
  [[nodiscard]] double seconds(std::uint64_t haptic_steps) const noexcept {
    return scene_.settings.h_s * static_cast<double>(haptic_steps);
  }
  /// Whether user u's sub-world waits for the frame of the present stamp.
  [[nodiscard]] bool waits_for_frame(const User& user) const noexcept {
    return !user.suppression.lacks_frame(facts_.stamp);
  }
  /// Of the reports on what the users do in the cycle under way.
  [[nodiscard]] std::uint64_t report_stamp() const noexcept {
    return facts_.stamp + static_cast<std::uint64_t>(scheme_.properties.lead_cycles);
  }
  void set_stamp(std::uint64_t stamp) noexcept;
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
  WorldFacts facts_;  ///< the length and sub-steps of the cycle under way while there is one
  std::uint64_t remembered_;
  Timetable timetable_;
  RatioControl ratio_control_;
  EngineCost engine_cost_;      ///< of the engine in use
  EngineSettings next_engine_;  ///< that was asked for
  CostCorrection correction_{kTracking};
  CycleCost cycle_cost_;
  std::vector<BodyId> near_;
  ContactTotals totals_;               ///< of the sub-steps
  std::vector<Contact> settled_;       ///< as if the last step of settling had been a cycle
  std::span<const Contact> contacts_;  ///< of the last cycle
  bool reads_friction_;                ///< somebody may
  bool reads_friction_later_;          ///< and knows only when the step is over
  bool lacks_friction_ = false;        ///< contacts_ does
  ContactGraph graph_;
  std::vector<Motion> motions_;  ///< by body, in the last cycle
  SharedIslands shared_;
  std::vector<const HapticReport*> reports_;  ///< by user, while shared islands are merged
  FrameMaker frames_;
  std::vector<Heard> heard_;       ///< by user, while frames are made
  std::vector<UserPull> pulls_;    ///< of the users that have been heard
  std::vector<double> energy_j_;   ///< kinetic and potential, by stamp
  EnergyPort operators_;           ///< of all users as one
  double created_before_j_ = 0.0;  ///< by operators, before the world was resumed
  double start_energy_j_ = 0.0;
  double resting_j_ = 0.0;    ///< of what sleeps
  double of_bodies_j_ = 0.0;  ///< kinetic and potential, without the proxies' motion
};

}  // namespace subworld
