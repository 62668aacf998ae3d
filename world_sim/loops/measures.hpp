#pragma once

#include "io/results/program_results.hpp"
#include "program/loop_measures.hpp"
#include "world_sim/body_history.hpp"
#include "world_sim/world.hpp"

#include <array>
#include <string>
#include <vector>

namespace subworld {

inline constexpr std::array kWorldStages{"wake",     "receive", "decode",  "control", "synchronise",
                                         "simulate", "account", "extract", "send",    "display"};
static_assert(kWorldStages.size() == Stages<WorldStage>::kCount);

/// What the world process says of itself at the end, and its history on the way.
class WorldMeasures : public LoopMeasures<WorldStage> {
 public:
  static constexpr double kNotBack_s = -1.0;

  /// Throws `Error` (failed, usage) for what --out, --trace, --bodies and --bodies-rate ask for.
  WorldMeasures(const Options& options, const Scene& scene, const History::Say& say);

  /// The world goes on from a checkpoint of the run in this folder.
  void goes_back() noexcept {
    history_.append();
    bodies_.goes_back();
  }
  /// The world goes on at `at_s` from a checkpoint with these absences, and waits for all users.
  void resume(std::vector<Absence> absences) { absences_ = std::move(absences); }
  [[nodiscard]] const std::vector<Absence>& absences() const noexcept { return absences_; }
  [[nodiscard]] BodyHistory& bodies() noexcept { return bodies_; }

  /// After every cycle. `wall_s`: its period on a clock that runs at `real_time_factor`; 0 in lock-step.
  void cycle(const World& world, const StepTimes& times, double real_time_factor, double wall_s) noexcept;
  /// Closes the cycle's stages: the last of all.
  void end_cycle() noexcept;
  /// Wall time for which the world needed more than its slowest clock gave it.
  void stuck(double wall_s) noexcept { stuck_s_ += wall_s; }
  void engine_changed(const EngineChange& change) { engine_changes_.push_back(change); }
  /// A user is absent from then on, and takes part again, in simulated time.
  void leaves(std::size_t user, double at_s, bool by_order) { absences_.push_back({user, at_s, kNotBack_s, by_order}); }
  /// By order, and nobody has come in its place.
  [[nodiscard]] bool has_left(std::size_t user) const noexcept;
  [[nodiscard]] bool is_absent(std::size_t user) const noexcept;
  void returns(std::size_t user, double at_s) noexcept;
  [[nodiscard]] double absent_from_s(std::size_t user) const noexcept;
  /// Who has joined and left, in lock-step.
  void took_part(const std::vector<PresenceEvent>& events) { presence_ = to_text(events); }
  void lost_report() noexcept { ++lost_reports_; }
  void refused_report() noexcept { ++refused_reports_; }

  /// What the status shows.
  [[nodiscard]] LoopState state(const World& world, double real_time_factor) const noexcept {
    return LoopMeasures::state(world.facts().time_s, 0.0, real_time_factor);
  }
  /// After the last cycle.
  [[nodiscard]] WorldPart result(const World& world, double settle_s);
  /// Why a history could not be written; empty: all could.
  [[nodiscard]] std::string fault() const { return history_.fault().empty() ? bodies_.fault() : history_.fault(); }

 private:
  const Scene& scene_;
  History::Say say_;
  BodyHistory bodies_;
  std::size_t broken_joints_ = 0;  ///< that were noted
  double newest_real_time_factor_ = 1.0;
  std::uint64_t lost_reports_ = 0, refused_reports_ = 0;
  std::vector<MeanMax> omitted_;  ///< bodies, by user
  MeanMax ratio_, substeps_;
  double real_time_factor_min_ = 1.0;
  double simulated_s_ = 0.0, wall_s_ = 0.0;  ///< of all cycles
  double slowed_s_ = 0.0, stuck_s_ = 0.0;    ///< wall time with a real-time factor below 1, and below its floor
  std::vector<EngineChange> engine_changes_;
  std::vector<Absence> absences_;
  std::string presence_;
};

}  // namespace subworld
