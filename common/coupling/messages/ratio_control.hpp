#pragma once

#include "model/scene/scene.hpp"

#include <functional>

namespace subworld {

/// What the world needs for a cycle of this length and so many parts, s; 0: nobody economises.
using CycleCost = std::function<double(double cycle_s, int parts)>;

/// Chooses the simulation ratio within the settings' bounds, and into how many parts the world divides a cycle (paper
/// 4.6).
///
/// While forces across a border are felt, cycles are as short as the world can afford: the smallest r with
///     C(r h, 1) <= kShare r h,
/// C(T, p) the cost of a cycle of length T in p parts. Else nothing that is felt has to cross, and r is the largest.
/// A cycle has as many sub-steps as the scheme wants, or as it can afford. So a world that is too slow first makes
/// fewer parts, then longer cycles; then its clock slows.
///
/// Hysteresis: what there is stays until it costs more than kOverShare; a border counts as felt, and a cost as high,
/// for kSettled_s longer than it is.
class RatioControl {
 public:
  static constexpr double kShare = 0.6;  ///< of a cycle for the world; the rest is for what takes longer now and then
  static constexpr double kOverShare = 0.75;
  static constexpr double kSettled_s = 0.25;

  explicit RatioControl(const Settings& settings);

  /// Other bounds from now on.
  void set_bounds(const RatioBounds& bounds) noexcept {
    least_ = bounds.least;
    most_ = bounds.most;
  }
  /// After a cycle of `cycle_s`: the ratio that should follow the present one.
  [[nodiscard]] int choose_ratio(int present, bool border_is_felt, double cycle_s, const CycleCost& cost);
  /// Sub-steps of a cycle; `longest_substep_s`: of the scheme; `time_s`: wall time for it on a clock at full speed.
  /// That is the length of the cycle which a sub-world ahead simulates meanwhile: another one where the ratio changes.
  [[nodiscard]] int choose_substeps(int present, double cycle_s, double longest_substep_s, double time_s,
                                    const CycleCost& cost) const;

 private:
  [[nodiscard]] int smallest_affordable(double share, const CycleCost& cost) const;

  double h_s_;
  int least_, most_;
  int given_parts_;       ///< by the scene; 0: as wanted and affordable
  double quiet_s_ = 0.0;  ///< for which no border was felt
  double cheap_s_ = 0.0;  ///< for which a smaller ratio was affordable
};

}  // namespace subworld
