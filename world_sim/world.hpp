#pragma once

#include "coupling/schemes/scheme.hpp"
#include "coupling/sync/shared_islands.hpp"
#include "coupling/tool/tool.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/shells/engine_exchange.hpp"
#include "physics/shells/resting_engine.hpp"
#include "world_sim/accounts.hpp"
#include "world_sim/cycle_contacts.hpp"
#include "world_sim/cycle_plan.hpp"
#include "world_sim/facts.hpp"
#include "world_sim/frame_maker.hpp"
#include "world_sim/user_link.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace subworld {

struct WorldCheckpoint;

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
    return links_[user].reports().has(stamp);
  }

  /// Reports of the user do not come: until the next one, the coupling holds the proxy.
  void hold(std::size_t user) { links_[user].time_out(facts_.stamp, proxy(user)); }
  /// Before the first cycle: the user is absent until a sub-world reports that has started from a frame of this stamp
  /// or a later one.
  void begin_without(std::size_t user) { links_[user].leave(proxy(user), facts_.stamp); }
  /// The user is absent from now on, until reports come of a sub-world that has started from a frame of a later stamp.
  void leave(std::size_t user) { links_[user].leave(proxy(user), facts_.stamp + 1); }

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
  void took(double cost_s) noexcept { plan_.took(facts_.cycle_s, facts_.substeps, load(), cost_s); }
  /// After the last cycle: applies the reports that have arrived since, and adds the final states to the hash.
  void close();

  /// Asks for another engine. Returns what came of it; exchange_engine() hands over between two steps,
  /// when the other one is ready.
  OrderAnswer change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);
  /// Narrows the bounds between which the simulation ratio adapts: `text` as in "4" or "4-8". Refused outside the
  /// scene's bounds, for which all programs have made room.
  OrderAnswer change_ratio(const std::string& text) { return plan_.change_ratio(text); }

  [[nodiscard]] const WorldFacts& facts() const noexcept { return facts_; }
  [[nodiscard]] UserFacts user_facts(std::size_t user) const noexcept;
  /// The world at the present stamp as user u sees it; new after each step().
  [[nodiscard]] WorldFrame& frame(std::size_t user) { return frames_.frame(user, facts_.stamp); }
  /// Where the user's coupling is held that exerts the wrench of the last cycle on the proxy at rest.
  [[nodiscard]] Pose device(std::size_t user) const { return links_[user].device(proxy(user)).pose; }
  /// Allocates only until the view has grown to the world.
  void look(WorldView& view) const;
  /// Indices, in the order in which they broke.
  [[nodiscard]] std::span<const std::uint32_t> broken_joints() const noexcept { return frames_.broken_joints(); }
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return plan_.timetable(); }
  [[nodiscard]] const RestingEngine& engine() const noexcept { return engine_; }

 private:
  void synchronise();
  void simulate();
  /// Takes over what the sub-worlds say of islands that they share.
  void merge_shared();
  void account() { accounts_.observe(engine_, tools_, facts_); }
  void make_frames();
  void apply(std::size_t user, const HapticReport& report);
  /// Passes the users' impulses on to the cycle under way.
  void pass_impulses();
  void drive_proxies(double until_s, double dt);
  /// The proxy's dynamics at the rate of the haptic clock.
  void set_rate(std::size_t user, double rate);
  void set_inertia(const Body& proxy) { engine_.set_inertia(proxy.id, proxy.mass, proxy.inertia); }
  void pull(std::size_t user, const DevicePose& target, const ForceLimits& limits, double dt);
  [[nodiscard]] BodyState proxy(std::size_t user) const { return engine_.state(scene_.users[user].proxy); }
  /// By how much the world's positions are ahead of the sub-worlds' where both account for the same forces: half the
  /// difference of their steps. Frames tell what a sub-world of the same forces would have.
  [[nodiscard]] double half_step_offset_s() const;
  /// Of the reports on what the users do in the cycle under way.
  [[nodiscard]] std::uint64_t report_stamp() const noexcept {
    return facts_.stamp + static_cast<std::uint64_t>(scheme_.properties.lead_cycles);
  }
  void set_stamp(std::uint64_t stamp) noexcept;
  [[nodiscard]] CycleLoad load() const { return {engine_.awake().size(), contacts_.all().size()}; }
  void begin_cycle();
  /// Lets sleep what rests and wakes what may be reached before the next look, after `dt` of simulation.
  void rest(double dt);
  void simulate_cycle();
  /// Breaks the joints that carried too much in a step of `dt`.
  void break_joints(double dt);
  void break_joint(std::size_t joint);

  const Scene& scene_;
  const Scheme& scheme_;
  std::unique_ptr<WorldSide> side_;  ///< of the scheme
  bool has_driven_surfaces_;
  LiveEngine live_;
  RestingEngine engine_;
  std::vector<UserLink> links_;   ///< by user
  std::vector<RatedTool> tools_;  ///< by user, at the rate of the haptic clock in the cycle that the world simulates
  std::vector<BodyId> driven_;    ///< proxies that are held or follow reports
  WorldFacts facts_;              ///< the length and sub-steps of the cycle under way while there is one
  CyclePlan plan_;
  CycleContacts contacts_;
  SharedIslands shared_;
  FrameMaker frames_;
  WorldAccounts accounts_;
};

}  // namespace subworld
