#pragma once

#include "io/ending.hpp"
#include "world_sim/checkpoint/checkpoint_writer.hpp"
#include "world_sim/loops/measures.hpp"
#include "world_sim/loops/ports.hpp"
#include "world_sim/loops/run_control.hpp"
#include "world_sim/world.hpp"

namespace subworld {

/// Everything that a run of the world process consists of.
struct WorldRun {
  const Options& options;
  const Scene& scene;
  WorldPorts& ports;
  World& world;
  WorldMeasures& measures;
  EngineExchange& exchange;
  CheckpointWriter& checkpoints;
  const std::vector<bool>& awaited;  ///< by user: the run does not begin without this user
};

/// By user, whether the run waits for this user at its start: not for those of --without or who join later as planned,
/// nor for those who were absent when the world that is resumed ended. Where that leaves none, it waits for all who
/// have not left by order.
[[nodiscard]] std::vector<bool> awaited_users(const Options& options, const Scene& scene,
                                              const std::vector<Absence>& absences);

/// Waits until the haptic process of every user who is awaited has joined. False when asked to stop. Throws `Error`
/// (failed) that names who is missing.
[[nodiscard]] bool await_peers(WorldPorts& ports, const Options& options, const std::vector<bool>& awaited);

/// Lock-step: each cycle waits for every user's report. Throws `Error` (failed) when a haptic process dies or is
/// started again, or the world is no longer finite.
[[nodiscard]] Ending run_lockstep(const WorldRun& run);

/// Real time: the clock starts when every awaited haptic process has answered, or throws `Error` (failed) after
/// `options.wait_s` seconds. Absolute deadlines; reports are used as they come. A world that cannot keep up slows its
/// clock, not its step. It goes on for those users who are there, until none is left; that others have gone is a fault.
[[nodiscard]] Ending run_realtime(const WorldRun& run);

/// What both loops of the world process do in a cycle, but for waiting.
class WorldLoop : protected WorldRun {
 protected:
  explicit WorldLoop(const WorldRun& run);

  [[nodiscard]] std::size_t user_count() const noexcept { return ports.frames.size(); }
  /// Follows the orders that have come, and changes the engine once the new one is ready.
  void follow_orders();
  /// Follows an order, and records it where it alters the world.
  OrderAnswer follow(const Control& order);
  /// Uses the engine that has been ordered, once it is ready.
  void follow_exchange();
  /// Ends the part of a user in the run, in real time: the user is absent from now on, and its programs end. Others may
  /// join in their place.
  [[nodiscard]] OrderAnswer dismiss(const std::string& number);
  /// Whether that user gets last frames.
  [[nodiscard]] bool dismisses(std::size_t user) const noexcept { return farewells_[user] > 0; }
  /// Publishes each user's frame; the last one in any case. `start_in_s`: see WorldFrame.
  void publish_frames(bool last, double start_in_s, double real_time_factor);
  void publish_frame(std::size_t user, bool last, double start_in_s, double real_time_factor);
  /// Who is absent at the end without an order, and why.
  [[nodiscard]] std::string absent_at_end() const;
  /// Closes a cycle's stages. Throws `Error` (failed) where a body's state is not finite.
  void end_cycle();
  /// The last frames and reports: writes the last states, and waits for readers.
  void close();
  /// How the run ended.
  [[nodiscard]] Ending ending() const;

  Stages<WorldStage>& stages_;
  RunControl control_;
  const SchemeProperties& scheme_;
  const double from_s_;                ///< simulated time at which the run began, not 0 where the world was resumed
  HapticReport report_;                ///< the newest received
  std::vector<PresenceEvent> events_;  ///< recorded
  std::vector<int> farewells_;         ///< by user: last frames that are still to be sent, because some may get lost
};

}  // namespace subworld
