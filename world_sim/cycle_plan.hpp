#pragma once

#include "coupling/messages/ratio_control.hpp"
#include "coupling/messages/timetable.hpp"
#include "coupling/schemes/scheme.hpp"
#include "coupling/select/budget.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/engine.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// What a step of the world's engine costs by.
struct CycleLoad {
  std::size_t bodies = 0;  ///< awake
  std::size_t contacts = 0;
};

/// The lengths and the sub-steps of the world's cycles, by what they cost.
class CyclePlan {
 public:
  CyclePlan(const Scene& scene, const Scheme& scheme, const EngineSettings& engine);

  /// The world goes on at a stamp that is `step` haptic steps after t = 0.
  void resume(std::uint64_t stamp, std::uint64_t step, int ratio, const RatioChange& planned);
  /// Sub-steps of the cycle that begins at a stamp, after one of `present`. `longest_s`: step of the engine. `divides`:
  /// what operators do is passed on between steps.
  [[nodiscard]] int substeps(std::uint64_t stamp, int present, double longest_s, bool divides,
                             const CycleLoad& load) const;
  /// Whether the ratio of a later cycle is to be chosen at this stamp.
  [[nodiscard]] bool is_due(std::uint64_t stamp) const noexcept {
    return settings_.adapts_ratio() && timetable_.newest().stamp <= stamp;
  }
  /// Until when the choice counts at least, s after a stamp whose last cycle had this length.
  [[nodiscard]] double ahead_s(double cycle_s) const noexcept;
  /// Chooses it, after a cycle of `cycle_s`; returns whether it changes. `felt`: forces across a border are, or may be
  /// before the choice takes effect.
  bool choose(std::uint64_t stamp, double cycle_s, bool felt, const CycleLoad& load);
  /// Narrows the bounds between which the ratio adapts.
  OrderAnswer change_ratio(const std::string& text);
  /// What a cycle took: corrects what cycles are thought to cost.
  void took(double cycle_s, int substeps, const CycleLoad& load, double cost_s) noexcept {
    correction_.observe(published_cost_s(cycle_s, substeps, load), cost_s);
  }
  /// Another engine has been asked for, and is in use now.
  void ask_for(const EngineSettings& engine) { next_engine_ = engine; }
  void exchange_engine() { engine_cost_ = engine_cost(next_engine_); }

  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }
  [[nodiscard]] double seconds(std::uint64_t haptic_steps) const noexcept {
    return settings_.h_s * static_cast<double>(haptic_steps);
  }
  /// Length of the cycle that begins at a stamp.
  [[nodiscard]] double cycle_s(std::uint64_t stamp) const noexcept {
    return seconds(static_cast<std::uint64_t>(timetable_.ratio(stamp)));
  }

 private:
  static constexpr double kTracking = 0.05;  ///< of what a cycle costs, in a cycle

  /// By the published coefficients of the engine, s.
  [[nodiscard]] double published_cost_s(double cycle_s, int parts, const CycleLoad& load) const noexcept {
    return parts * engine_cost_.step(cycle_s / parts).of(load.bodies, load.contacts);
  }
  [[nodiscard]] CycleCost cost(const CycleLoad& load) const;

  const Settings& settings_;
  const Scheme& scheme_;
  bool economises_;
  Timetable timetable_;
  RatioControl ratio_control_;
  EngineCost engine_cost_;      ///< of the engine in use
  EngineSettings next_engine_;  ///< that was asked for
  CostCorrection correction_{kTracking};
};

}  // namespace subworld
