#pragma once

#include "model/messages/exchange.hpp"
#include "world_sim/frame_maker.hpp"

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace subworld {

/// What can be seen of the world at one stamp.
struct WorldView {
  double stamp_s = 0.0;
  double real_time_factor = 1.0;
  std::vector<BodyState> states;  ///< by body id
  std::vector<UserView> users;
  std::vector<std::uint32_t> broken_joints;
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
  /// Taken by all operators together from what none of them had put in (coupling/safety/energy_port).
  double operators_created_j = 0.0;
};

/// A user's sub-world at the present stamp.
struct UserFacts {
  bool waits_for_frame = true;              ///< the frame of this stamp is to be sent
  std::span<const BoundaryContact> border;  ///< contacts with bodies outside, and what may become one
  std::size_t outside = 0;                  ///< bodies there whose states the sub-world gets
  SelectionFacts selection;
  Wrench impulse;                  ///< of the user on the proxy that has been passed on to the world, since the start
  std::uint64_t newest_stamp = 0;  ///< of the newest report received
  bool absent = false;             ///< the world holds the proxy, and uses no report that has not seen that
};

}  // namespace subworld
