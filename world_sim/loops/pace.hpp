#pragma once

#include "rt/dilation.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

namespace subworld {

/// How fast a world's clock runs in real time. A world that needs more than its cycle keeps its step and slows its
/// clock for everybody (time dilation) to the factor
///   f = kShare T / C,  C the smoothed cost of a cycle, kLeastRealTimeFactor <= f <= 1,
/// which changes by at most kStep a cycle, and falls at once where the cost has trebled: then a cycle may take so long
/// that small steps would take minutes. A single late cycle is caught up with and does not slow the clock.
class Pace {
 public:
  static constexpr double kShare = 0.9;  ///< of a slowed cycle for the world; the rest is left to other threads
  static constexpr double kStep = 0.05;  ///< most that the factor changes in a cycle, as a part of it

  enum class News : std::uint8_t { none, slowed, stuck, recovered };

  explicit Pace(double cycle_s) noexcept : cycle_s_(cycle_s) {}

  /// Before each cycle: how much simulated time it covers.
  void begin(double cycle_s) noexcept { cycle_s_ = cycle_s; }
  /// After each cycle. `cost_s`: the time it took; `late_s`: by how much it ended after its period (negative: before).
  /// Returns by how much the coming releases move, s: lateness that is not caught up with.
  double cycle(double cost_s, double late_s) noexcept;

  [[nodiscard]] double real_time_factor() const noexcept { return factor_; }
  /// Wall time of a cycle, s.
  [[nodiscard]] double period_s() const noexcept { return cycle_s_ / factor_; }
  /// Smoothed cost of a cycle, s.
  [[nodiscard]] double cost_s() const noexcept { return cost_s_; }
  /// The world needs more than a cycle even of the slowest clock.
  [[nodiscard]] bool stuck() const noexcept { return slowed_ && kShare * cycle_s_ < kLeastRealTimeFactor * cost_s_; }
  /// News for the user, once; a clock that slows again within a second of recovery is no news.
  [[nodiscard]] News take_news() noexcept;

 private:
  void observe(double cost_s) noexcept;

  double cycle_s_;
  double factor_ = 1.0;
  bool slowed_ = false;
  double cost_s_ = 0.0;
  std::array<double, 5> newest_costs_s_{};
  std::size_t cycles_ = 0;
  double steady_s_ = 0.0;        ///< wall time for which the clock has run at full speed
  double at_target_s_ = 0.0;     ///< wall time for which a slowed clock has been near its target
  News said_ = News::recovered;  ///< what the user knows
};

}  // namespace subworld
