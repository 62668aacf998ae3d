#pragma once

#include "io/history.hpp"
#include "io/program_results.hpp"
#include "io/trace.hpp"
#include "rt/histogram.hpp"
#include "rt/stages.hpp"
#include "wire/status.hpp"
#include "world_sim/body_history.hpp"
#include "world_sim/world.hpp"

#include <array>
#include <string>
#include <vector>

namespace subworld {

enum class WorldStage : std::uint8_t {
  wake,
  receive,
  decode,
  control,
  synchronise,
  simulate,
  account,
  extract,
  send,
  display,
  count
};
inline constexpr std::array kWorldStages{"wake",     "receive", "decode",  "control", "synchronise",
                                         "simulate", "account", "extract", "send",    "display"};
static_assert(kWorldStages.size() == Stages<WorldStage>::kCount);

/// What the world process says of itself at the end, and its history on the way.
class WorldMeasures {
 public:
  /// `folder` and `trace` may be empty: nothing is written.
  WorldMeasures(const std::string& folder, const std::string& trace, const History::Say& say,
                const BodyRecording& recording = {});

  [[nodiscard]] Stages<WorldStage>& stages() noexcept { return stages_; }
  [[nodiscard]] BodyHistory& bodies() noexcept { return bodies_; }

  /// After every cycle. `wall_s`: its period on a clock that runs at `real_time_factor`; 0 in lock-step.
  void cycle(const World& world, const StepTimes& times, double real_time_factor, double wall_s) noexcept;
  /// Closes the cycle's stages: the last of all.
  void end_cycle() noexcept;
  /// Wall time for which the world needed more than its slowest clock gave it.
  void stuck(double wall_s) noexcept { stuck_s_ += wall_s; }
  /// Around the loop in real time, in its thread.
  void loop_begins(const Scheduling& granted) { machine_.begin(granted); }
  void loop_ends() { machine_.end(); }
  void engine_changed(const EngineChange& change) { engine_changes_.push_back(change); }
  void lost_report() noexcept { ++lost_reports_; }
  void refused_report() noexcept { ++refused_reports_; }

  /// What the status shows.
  [[nodiscard]] LoopState state(const World& world, double real_time_factor) const noexcept {
    return {world.time_s(), world.stamp(), late_.all(), late_.by_os, step_.sum_s(), 0.0, real_time_factor};
  }
  /// After the last cycle.
  [[nodiscard]] WorldPart result(const World& world, std::size_t bodies, double settle_s);
  /// Why a history could not be written; empty: all could.
  [[nodiscard]] std::string fault() const { return history_.fault().empty() ? bodies_.fault() : history_.fault(); }

 private:
  History history_;
  BodyHistory bodies_;
  Stages<WorldStage> stages_;
  Trace trace_;
  double newest_lateness_s_ = 0.0, newest_real_time_factor_ = 1.0;
  bool newest_late_ = false;
  Histogram step_, lateness_, woken_late_;
  Misses late_;
  MachineShare machine_;
  std::uint64_t cycles_ = 0, lost_reports_ = 0, refused_reports_ = 0;
  std::vector<MeanMax> omitted_;  ///< bodies, by user
  MeanMax ratio_, substeps_;
  double real_time_factor_min_ = 1.0;
  double simulated_s_ = 0.0, wall_s_ = 0.0;  ///< of all cycles
  double slowed_s_ = 0.0, stuck_s_ = 0.0;    ///< wall time with a real-time factor below 1, and below its floor
  std::vector<EngineChange> engine_changes_;
};

}  // namespace subworld
