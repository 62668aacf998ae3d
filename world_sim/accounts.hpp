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
  /// The energy's start, after settling.
  void begin(const WorldFacts& facts) noexcept { start_energy_j_ = facts.kinetic_j + facts.potential_j; }
  /// In place of settling: observes the states, and goes on with the sums of the checkpoint.
  void resume(const WorldCheckpoint& from, const RestingEngine& engine, std::span<const RatedTool> tools,
              WorldFacts& facts);
  /// The energy of the bodies against the work of the devices, as far as all users have reported it.
  void balance(std::span<const UserLink> links, WorldFacts& facts);

  /// By body, in the last cycle.
  [[nodiscard]] std::span<const Motion> motions() const noexcept { return motions_; }

 private:
  [[nodiscard]] double potential_j(BodyId id) const noexcept;

  const Scene& scene_;
  std::vector<Motion> motions_;    ///< by body
  std::vector<double> energy_j_;   ///< kinetic and potential, by stamp
  EnergyPort operators_;           ///< of all users as one
  double created_before_j_ = 0.0;  ///< by operators, before the world was resumed
  double start_energy_j_ = 0.0;
  double resting_j_ = 0.0;      ///< of what sleeps
  double above_least_j_ = 0.0;  ///< of what is awake: energy above the least that each body has had
  double fallen_j_ = 0.0;       ///< lost below that and not given to operators
  double of_bodies_j_ = 0.0;    ///< kinetic and potential, without the proxies' motion
};

}  // namespace subworld
