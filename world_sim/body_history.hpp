#pragma once

#include "io/options/options.hpp"
#include "io/records/history.hpp"
#include "io/results/program_results.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

class World;

/// Which bodies of a scene are written down, and how often.
struct BodyRecording {
  std::vector<BodyId> bodies;      ///< none: nothing is written
  std::vector<std::string> names;  ///< of those
  double interval_s = 0.0;         ///< simulated time from one instant to the next; 0: every cycle
  bool may_wait = false;           ///< the world waits for the file: in lock-step nothing is dropped
};

/// The states of bodies over time (paper 3.1) in FOLDER/bodies.csv, a row for each body and instant: so a spreadsheet
/// filters by body or by time, and neither the number of columns nor their names depend on the scene. An instant is
/// written whole or not at all. As in world.csv the states are those at the end of a cycle, before the corrections that
/// the next one begins with.
class BodyHistory {
 public:
  /// As --bodies and --bodies-rate ask for. Without a rate: every cycle, or as many cycles apart as keep the file
  /// within 10,000 rows a simulated second. Throws `Error` (failed) where the file cannot be opened, (usage) for a body
  /// that the scene does not have, or where bodies are to be written and there is no folder.
  BodyHistory(const Options& options, const Scene& scene, History::Say say);

  /// The world goes on from a checkpoint of the run in this folder.
  void goes_back() noexcept { history_.append(); }
  /// After every cycle, at the world's present stamp. In real time it allocates nothing and never waits: an instant
  /// that does not fit into the `room_s` seconds which are left of the cycle, or into the memory that waits for the
  /// file, is dropped and counted.
  void record(const World& world, double room_s) noexcept;
  /// Before the first cycle and after the last: whatever the rate and the time it takes.
  void record_now(const World& world) noexcept;

  /// After the last instant: file, bodies, interval, rows, rows dropped; nothing where no bodies are written.
  [[nodiscard]] std::optional<BodyHistoryResult> result();
  /// Why rows could not be written, in words; empty: all could.
  [[nodiscard]] std::string fault() const { return history_.fault(); }

 private:
  /// False where the instant does not fit.
  bool write(const World& world, bool may_wait) noexcept;
  void drop(double time_s) noexcept;

  BodyRecording recording_;
  History history_;
  std::int64_t instant_ = -1;  ///< the last that was due, counted in intervals
  double written_s_ = -1.0;    ///< the time of the last one written
  double dropped_s_ = -1.0;    ///< and of the last one dropped
  double cost_s_ = 0.0;        ///< of an instant in the loop, without what held it up
  std::uint64_t rows_ = 0, dropped_ = 0;
};

}  // namespace subworld
