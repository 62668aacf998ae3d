#pragma once

#include "haptic_sim/loops/head_start.hpp"
#include "haptic_sim/loops/phase.hpp"
#include "haptic_sim/loops/run.hpp"
#include "rt/arrears.hpp"
#include "rt/dilation.hpp"

#include <algorithm>

namespace subworld {

/// The haptic clock in real time, which follows the world's.
class WorldClock {
 public:
  WorldClock(const HapticRun& run, const FirstFrame& first)
      : sub_(run.sub),
        settings_(run.scene.settings),
        lead_cycles_(run.scheme().lead_cycles),
        stagger_s_(settings_.h_s * run.user() / settings_.users),
        world_begins_(first.received + from_seconds(first.frame.start_in_s)),
        head_start_(first.round_trip_s, settings_.longest_cycle_s()),
        phase_(new_phase()),
        begins_(world_begins_ - from_seconds(ahead_s(first.frame.stamp) + head_start_s())) {
    // One that joins a running world begins behind it.
    arrears_.owe(std::max(0.0, to_seconds(Clock::now() - begins_)));
  }

  /// A frame has come at `now`, in the step that was released then. `served`: the world uses this user's reports.
  void observe(const WorldFrame& frame, bool served, TimePoint now, TimePoint released) noexcept {
    if (served) {
      head_start_.observe(frame.stamp, frame.newest_stamp, settings_.longest_cycle_s());
    } else {
      head_start_.wait();
    }
    phase_.observe(frame.stamp_s, ahead_s(frame.stamp), head_start_s(), to_seconds(now - released) + frame.start_in_s,
                   frame.real_time_factor, sub_.facts().time_s + arrears_.owed_s(), to_seconds(now - world_begins_));
  }
  /// Steps that take so much wall time are skipped.
  void skip(double wall_s) noexcept { arrears_.owe(wall_s * phase_.rate()); }
  /// The sub-world starts anew.
  void restart() noexcept {
    arrears_.forget();
    phase_.restart();
  }
  /// The world has been started again.
  void follow_anew() noexcept { phase_ = new_phase(); }

  /// For the step that begins now: simulated seconds per second.
  double step() noexcept { return phase_.step(sub_.facts().time_s, settings_.h_s); }
  /// Simulated time that the step covers; none in some steps of a slowed clock. The cores are too few then: the force
  /// goes on in each step, and the world gets what the others would have cost.
  double step_s(double rate) noexcept {
    return arrears_.step(settings_.h_s * rate, sub_.clock().left_s(), settings_.h_s);
  }

  [[nodiscard]] const Phase& phase() const noexcept { return phase_; }
  [[nodiscard]] TimePoint world_begins() const noexcept { return world_begins_; }
  /// When the sub-world is to begin, to be ahead of the world's clock as it should.
  [[nodiscard]] TimePoint begins() const noexcept { return begins_; }
  /// Without a frame for so long, the world is away. One that runs slowly sends them rarely.
  [[nodiscard]] double patience_s() const noexcept {
    const double factor = std::max(phase_.real_time_factor(), kLeastRealTimeFactor);
    return std::max(kAbsent_s, 4.0 * settings_.longest_cycle_s() / factor);
  }

 private:
  /// By how much the haptic clock is ahead of the world's when that shows a frame's stamp. A world that trails the
  /// sub-world by a cycle has the cycle's report a haptic step before it needs it. Users' loops are released one after
  /// the other, so that those that share a core do not wait for each other.
  [[nodiscard]] double ahead_s(std::uint64_t stamp) const {
    if (lead_cycles_ == 0) return stagger_s_;
    const Timetable& timetable = sub_.clock().timetable();
    const std::uint64_t until = stamp + static_cast<std::uint64_t>(lead_cycles_);
    return settings_.h_s * static_cast<double>(timetable.start(until) - timetable.start(stamp) + 1) + stagger_s_;
  }
  /// Between hosts, the round trip on top of that, where the world trails the sub-world.
  [[nodiscard]] double head_start_s() const {
    return settings_.has_unknown_delay() && lead_cycles_ > 0 ? head_start_.head_start_s() : 0.0;
  }
  [[nodiscard]] Phase new_phase() const noexcept {
    return {settings_.longest_cycle_s(), lead_cycles_, settings_.has_unknown_delay()};
  }

  const SubWorld& sub_;
  const Settings& settings_;
  int lead_cycles_;
  double stagger_s_;
  TimePoint world_begins_;  ///< before, it sends no frames
  HeadStart head_start_;
  Phase phase_;
  Arrears arrears_;
  TimePoint begins_;
};

}  // namespace subworld
