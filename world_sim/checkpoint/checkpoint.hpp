#pragma once

#include "io/results/program_results.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "model/settings/agreed_settings.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

class World;

/// All that a world needs to go on from a stamp: the bodies' motion, the wrenches of the users' couplings and the
/// accounts since t = 0. After a resume every user joins anew, with accounts that begin at that stamp; until then the
/// coupling holds the proxy with that wrench.
///
/// The file, little-endian: magic, version, length of the file, the members in the order below (texts and lists after
/// their length), FNV-1a of all bytes before. It holds neither contacts nor what an engine keeps between two steps, so
/// a resumed run does not repeat the interrupted one bit by bit.
struct WorldCheckpoint {
  std::vector<NamedSetting> settings;  ///< agreed_settings() of the scene
  std::string engine;                  ///< in use
  std::uint64_t session = 0;           ///< of the run
  std::uint64_t stamp = 0;
  std::uint64_t haptic_steps = 0;  ///< from t = 0 to the stamp
  double time_s = 0.0;
  std::int32_t ratio = 1;  ///< of the cycle that begins at the stamp
  RatioChange planned;     ///< the newest change of the ratio
  std::uint64_t ratio_changes = 0;
  std::uint64_t state_hash = 0;
  double kinetic_j = 0.0, potential_j = 0.0;  ///< at the stamp
  double energy_excess_j = 0.0, released_j = 0.0, operators_created_j = 0.0;
  std::vector<BodyState> states;     ///< by body id
  std::vector<std::uint8_t> asleep;  ///< by body id: 1 while it sleeps
  std::vector<Pose> devices;         ///< by user: World::device()
  std::vector<std::uint32_t> broken_joints;
  std::vector<Absence> absences;  ///< of users, since t = 0; `to_s` < 0: not back
};

/// Copies what a checkpoint holds of a world, but for the states of its bodies, the settings, the session and the
/// absences.
void copy_accounts(const World& world, WorldCheckpoint& to);

/// The bytes of a checkpoint's file. Replaces the contents of `bytes`, whose memory is used again.
void encode(const WorldCheckpoint& checkpoint, std::string& bytes);
/// The inverse. Throws `Error` (failed) for bytes that are no complete checkpoint of this version, or hold impossible
/// values. The text begins with `file` and ends with the cure.
[[nodiscard]] WorldCheckpoint decode_checkpoint(std::string_view bytes, const std::string& file);
/// Sets length and checksum of bytes, for tests that change what is between.
void seal_checkpoint(std::string& bytes);

/// Reads a file, or the newest valid checkpoint of a folder. `skipped` gets the faults of the other files there.
/// Throws `Error` (failed) where there is none, (usage) for one that is not of this scene with these settings.
[[nodiscard]] WorldCheckpoint read_checkpoint(const std::string& path, const Scene& scene,
                                              std::vector<std::string>& skipped);

/// The two files of a folder that take turns: one is complete at any time.
[[nodiscard]] std::string checkpoint_file(const std::string& folder, std::uint64_t number);
/// Number of the file that does not hold the newest valid checkpoint of a folder.
[[nodiscard]] std::uint64_t next_checkpoint(const std::string& folder);

/// The scene with the bodies as they are in a checkpoint: where they are, how they move and which of them sleep. The
/// World of a resumed run is made from it.
[[nodiscard]] Scene resumed_scene(const Scene& scene, const WorldCheckpoint& checkpoint);

}  // namespace subworld
