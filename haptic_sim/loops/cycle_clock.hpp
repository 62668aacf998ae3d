#pragma once

#include "coupling/messages/timetable.hpp"
#include "model/messages/exchange.hpp"

#include <cmath>
#include <cstdint>

namespace subworld {

/// Where a sub-world is: which cycle is under way, and how much of it is over.
class CycleClock {
 public:
  /// `remembered_cycles`: how far back stamps are asked for.
  CycleClock(double h_s, int ratio, std::uint64_t remembered_cycles)
      : h_s_(h_s), timetable_(ratio, remembered_cycles) {}

  /// A step of `dt` s of simulated time is over.
  void advance(double dt) noexcept {
    in_cycle_s_ += dt;
    ++steps_;
  }
  /// The next cycle begins, at the stamp after this one.
  void next() noexcept {
    ++stamp_;
    begin();
  }
  /// The cycle under way begins anew.
  void begin() noexcept {
    in_cycle_s_ = 0.0;
    steps_ = 0;
  }
  /// Goes on from a frame.
  void restart(const WorldFrame& frame) {
    timetable_.restart(frame.stamp, static_cast<std::uint64_t>(std::llround(frame.stamp_s / h_s_)), frame.ratio);
    timetable_.plan(frame.planned);
    stamp_ = frame.stamp;
    begin();
  }
  /// A change of the ratio that is to come.
  void plan(const RatioChange& change) {
    if (change.stamp > stamp_) timetable_.plan(change);
  }
  /// Whether the frame counts cycles as this clock does. If not, a change of the ratio was missed: restart().
  [[nodiscard]] bool agrees(const WorldFrame& frame) const noexcept {
    const RatioChange& planned = frame.planned;
    return std::abs(start_s(frame.stamp) - frame.stamp_s) < 0.5 * h_s_ &&
           (planned.stamp > stamp_ || timetable_.ratio(planned.stamp) == planned.ratio);
  }

  /// Of the cycle under way; those before it are over.
  [[nodiscard]] std::uint64_t stamp() const noexcept { return stamp_; }
  /// Of the cycle under way, so far.
  [[nodiscard]] int steps() const noexcept { return steps_; }
  [[nodiscard]] double time_s() const noexcept { return start_s(stamp_) + in_cycle_s_; }
  /// Length of the cycle under way.
  [[nodiscard]] double cycle_s() const noexcept { return h_s_ * timetable_.ratio(stamp_); }
  /// The steps fill the cycle.
  [[nodiscard]] bool at_boundary() const noexcept { return in_cycle_s_ >= cycle_s() - 1e-6 * h_s_; }
  /// Simulated time until the next boundary.
  [[nodiscard]] double left_s() const noexcept {
    return at_boundary() ? h_s_ * timetable_.ratio(stamp_ + 1) : cycle_s() - in_cycle_s_;
  }
  /// How old the world's state of a stamp is.
  [[nodiscard]] double cycles_since(std::uint64_t stamp) const noexcept {
    return static_cast<double>(stamp_) - static_cast<double>(stamp) + in_cycle_s_ / cycle_s();
  }
  /// When a cycle begins.
  [[nodiscard]] double start_s(std::uint64_t stamp) const noexcept {
    return h_s_ * static_cast<double>(timetable_.start(stamp));
  }
  /// Cycles that are over, and that are coming, in haptic steps.
  [[nodiscard]] const Timetable& timetable() const noexcept { return timetable_; }

 private:
  double h_s_;
  Timetable timetable_;
  std::uint64_t stamp_ = 0;
  double in_cycle_s_ = 0.0;
  int steps_ = 0;
};

}  // namespace subworld
