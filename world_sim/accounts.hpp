#pragma once

#include "coupling/safety/energy_port.hpp"
#include "coupling/schemes/world_side.hpp"
#include "coupling/tool/tool.hpp"
#include "model/scene/scene.hpp"
#include "physics/shells/resting_engine.hpp"
#include "world_sim/facts.hpp"
#include "world_sim/user_link.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

struct WorldCheckpoint;

/// The motion of all bodies from stamp to stamp, the hash of their states, and where their energy has come from and
/// gone to. Fills the world's facts.
class WorldAccounts {
 public:
  WorldAccounts(const Scene& scene, std::uint64_t remembered_cycles);

  /// The body sleeps from now on.
  void sleeps(const RestingEngine& engine, BodyId id);
  /// Bodies have just fallen asleep and woken.
  void follow_rest(const RestingEngine& engine);
  /// The states of a new stamp.
  void observe(const RestingEngine& engine, std::span<const RatedTool> tools, WorldFacts& facts);
  /// Motors of joints or driven surfaces have done this work on the bodies, in the cycle under way.
  void drive_works(double work_j) noexcept {
    motors_j_ += work_j;
    fallen_j_ += std::max(0.0, work_j);
  }
  /// The springs of a joint that has broken are gone.
  void break_joint(std::size_t joint);
  /// The energy's start, after settling. `stored_j`: in the couplings.
  void begin(const WorldFacts& facts, double stored_j = 0.0) noexcept {
    explained_j_ = start_energy_j_ = facts.kinetic_j + facts.potential_j + stored_j;
  }
  /// In place of settling: observes the states, and goes on with the sums of the checkpoint.
  void resume(const WorldCheckpoint& from, const RestingEngine& engine, std::span<const RatedTool> tools,
              WorldFacts& facts);
  /// The energy of the bodies against the work of the devices, as far as all users have reported it.
  void balance(std::span<const UserLink> links, WorldFacts& facts);

  /// By body, in the last cycle.
  [[nodiscard]] std::span<const Motion> motions() const noexcept { return motions_; }

 private:
  [[nodiscard]] double potential_j(BodyId id) const noexcept;
  void observe_springs(const RestingEngine& engine);

  const Scene& scene_;
  std::vector<Motion> motions_;    ///< by body
  std::vector<double> energy_j_;   ///< kinetic and potential, by stamp
  EnergyPort operators_;           ///< of all users as one
  double created_before_j_ = 0.0;  ///< by operators, before the world was resumed
  double start_energy_j_ = 0.0;
  double explained_j_ = INFINITY;  ///< at the newest stamp that all users have reported: of the start, and given since
  double motors_j_ = 0.0;          ///< their work since the start
  std::vector<std::size_t> springs_;  ///< joints with springs
  std::vector<double> in_springs_j_;  ///< by body: of the joints in which it is the first one
  double resting_j_ = 0.0;            ///< of what sleeps
  double above_least_j_ = 0.0;        ///< of what is awake: energy above the least that each body has had
  double fallen_j_ = 0.0;             ///< lost below that and not given to operators
  double of_bodies_j_ = 0.0;          ///< kinetic and potential, without the proxies' motion
};

}  // namespace subworld
