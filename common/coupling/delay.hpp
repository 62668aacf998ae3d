#pragma once

#include "coupling/timetable.hpp"
#include "model/scene.hpp"

#include <cstdint>

namespace subworld {

/// When messages arrive in lock-step under an artificial delay: a pure function of the settings, so that both sides
/// know it and a run repeats bit by bit. Times are in haptic steps; messages of one direction arrive in order.
class Delay {
 public:
  /// `lead_cycles`: how many cycles the sub-world runs ahead of the world.
  Delay(const Settings& settings, int lead_cycles, std::uint32_t user) noexcept;

  /// The haptic step before which the sub-world has the frame of this stamp. A world that trails the sub-world by a
  /// cycle first waits for that cycle's report, then needs a cycle of its own.
  [[nodiscard]] std::uint64_t frame_due(std::uint64_t stamp, const Timetable& timetable) const noexcept;
  /// Whether a world at the stamp `world` has the report of this stamp.
  [[nodiscard]] bool report_due(std::uint64_t stamp, std::uint64_t world, const Timetable& timetable) const noexcept;
  /// Most cycles between a stamp and the use of its frame.
  [[nodiscard]] std::uint64_t longest_cycles() const noexcept;

 private:
  [[nodiscard]] std::uint64_t steps(double delay_s, std::uint64_t direction, std::uint64_t stamp) const noexcept;

  DelaySettings settings_;
  double h_s_;
  double shortest_cycle_s_;
  std::uint64_t lead_;
  std::uint64_t user_;
};

}  // namespace subworld
